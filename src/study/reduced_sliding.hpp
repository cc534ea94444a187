#pragma once
/// Small motions about sliding on a few shapes, for many values of the numbers (src/README.md, section 12.2).
///
/// The shapes T come from modes of other points, without their motion along the normals of the pairs: B_n T = 0. W are
/// responses to a normal force on each pair. S = [T, W of the other pairs] is lifted by W of the closed rigid ones to
/// what contact allows, with the rows B_n and R of those:
///     S_Z = S - W (B_n W)^-1 B_n S,   S_Y = S - W (R W)^-1 R S,   (lambda^2 S_Y'M S_Z + ...) y = 0
/// Closed pairs with a compliance are springs.
#include "polynomial_model.hpp"
#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/algebra/multivector.hpp"

namespace squeal
{

/// A symmetric or skew matrix on T and W; empty where the term has none.
struct OnShapes
{
  Eigen::MatrixXd TT{}, WT{}, WW{};
};

/// S_Y'M S_Z, S_Y'(C + G + C_f) S_Z, S_Y'(K + H + B'S B) S_Z, and K_loss, empty without loss factors.
struct ReducedMatrices
{
  Eigen::MatrixXd M{}, C{}, K{}, K_loss{};
  Eigen::Index common = 0; // shapes of T, which come first
};

/// Responses of K + omega^2 M to a normal force on each pair, of energy 1, and the rows of B on them.
struct PairShapes
{
  MultiVector W;
  Eigen::MatrixXd BW{};
};

PairShapes make_pair_shapes(const BrakeModel& model, double omega);

/// Shapes that grow while modes bring more than `truncation` of their energy that is new.
class ShapeCollection
{
public:
  /// `omega`: of the energy x'(K + omega^2 M)x.
  ShapeCollection(const BrakeModel& model, const PairShapes& pairs, double omega);

  /// The real parts of modes, then the imaginary ones.
  void add(MultiVector vectors, double truncation);

  const MultiVector& shapes() const { return shapes_; }

private:
  void take_normal_motion_off(MultiVector& vectors) const;

  const BrakeModel& model_;
  const PairShapes& pairs_;
  Owned<Mat> energy_;
  MultiVector shapes_; // orthonormal in energy
  MultiVector images_; // energy times shapes
};

class ReducedSliding
{
public:
  ReducedSliding(const PolynomialModel& model, const MultiVector& T, const PairShapes& pairs);

  /// `interface`: with the friction, the drive and the compliance of the point. Error: friction jams a closed pair.
  ReducedMatrices at(const std::vector<double>& coefficients, const Interface& interface,
                     const Equilibrium& equilibrium) const;

  Eigen::Index shapes() const { return BT_.cols(); }

private:
  std::array<std::vector<OnShapes>, matrices_of_structure.size()> terms_{}; // of each matrix
  Eigen::MatrixXd BT_, BW_;                                                 // rows of B on the shapes
};

} // namespace squeal
