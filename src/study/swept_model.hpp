#pragma once
/// The model at the points of a sweep, with what they share: its matrices, the compliance of its pairs and the basis of
/// its modes.
#include "point_modes.hpp"

#include <functional>
#include <map>
#include <optional>

namespace squeal
{

/// Where a pair opens or closes on the way from one point to another.
struct ContactChange
{
  double before = 0, behind = 0;  // values of the first number on either side of it
  std::optional<double> failed{}; // where an equilibrium failed in the search, which has no other result then
};

class SweptModel
{
public:
  /// Calls `end_if_asked` between parts of long work: equilibria of a search, corrections of the basis.
  /// Borrows the problem.
  SweptModel(const SweepProblem& problem, std::function<void()> end_if_asked);

  /// Finds the equilibrium of a point. The pairs that are closed at all points prepared are those of the basis.
  void prepare(const SweptPlace& place);

  /// The equilibrium at a point; its outcome says why one could not be computed.
  const Equilibrium& equilibrium_at(const SweptPlace& place) { return known_at(place).equilibrium; }
  PointModes modes_at(const SweptPlace& place, double tolerance);

  /// Gives back the memory of a point.
  void forget(const SweptPlace& place);

  /// Whether the same pairs are closed at two points, and the same of them rigid.
  bool same_pairs_closed(const SweptPlace& a, const SweptPlace& b);

  /// The number of pairs that are closed at one of two points alone; 0 where they have other pairs.
  int changed_pairs(const SweptPlace& a, const SweptPlace& b);

  /// The first change of contact between two points of a line, to `tolerance` of the first number. It is of a pair that
  /// is closed at one of them alone. Nothing: there is none.
  std::optional<ContactChange> contact_change(const SweptPlace& from, const SweptPlace& to, double tolerance);

  /// At the point visited last; null: at none.
  const Model* model() const { return model_ ? &*model_ : nullptr; }

  /// Shapes in the basis, and its corrections so far.
  Eigen::Index shapes() const;
  int passes() const { return basis_ ? basis_->passes : 0; }

private:
  void go_to(const SweptPlace& place);
  BasisProblem basis_problem(const Equilibrium& equilibrium) const;
  struct Known
  {
    Equilibrium equilibrium{};
    std::vector<char> rigid{}; // closed pairs without a compliance
  };

  const Known& known_at(const SweptPlace& place);

  const SweepProblem& problem_;
  std::function<void()> end_if_asked_;
  Equilibria searched_;
  std::optional<Model> model_{}; // at the point visited last
  SweptPlace at_{};
  std::map<SweptPlace, Known> known_{};
  std::vector<char> at_every_{}; // pairs closed and rigid at every point prepared
  std::optional<ModesBasis> basis_{};
};

} // namespace squeal
