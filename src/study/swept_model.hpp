#pragma once
/// The model at the points of a sweep, with what they share: its matrices, the compliance of its pairs and the basis of
/// its modes.
#include "lines.hpp"
#include "point_modes.hpp"

#include <map>
#include <optional>

namespace squeal
{

class SweptModel
{
public:
  explicit SweptModel(const SweepProblem& problem);

  /// Finds the equilibria of all points. The pairs that are closed at every one of them are those of the basis.
  void prepare(const std::vector<SweepLine>& lines);

  /// What cannot be computed at a point, for whatever reason, is in the outcome.
  const Equilibrium& equilibrium_at(const std::vector<double>& values, bool reversed);
  PointModes modes_at(const std::vector<double>& values, bool reversed);

  /// The vectors of modes found at the point visited last, in the structure's degrees of freedom: the real parts of
  /// all, then the imaginary ones.
  MultiVector vectors(const PointModes& modes, Side side) const;

  Eigen::Index shapes() const { return basis_ ? basis_->basis.shapes() : 0; }
  int passes() const { return basis_ ? basis_->passes : 0; }

private:
  using Point = std::pair<std::vector<double>, bool>; // values, and whether the rotation is reversed

  void go_to(const Point& point);
  Equilibrium find(const Point& point);
  const PairCompliance& compliance();
  BasisProblem basis_problem() const;

  const SweepProblem& problem_;
  EquilibriumOptions equilibrium_options_;
  std::optional<BranchModel> model_{}; // at the point visited last
  Point at_{};
  std::map<Point, Equilibrium> equilibria_{};
  std::vector<char> closed_{};   // at the equilibrium found last
  std::vector<char> at_every_{}; // pairs closed at every point prepared
  std::optional<PairCompliance> compliance_{};
  Owned<Mat> K_{}, B_{}; // of the compliance
  std::optional<ModesBasis> basis_{};
};

} // namespace squeal
