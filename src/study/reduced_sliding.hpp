#pragma once
/// Small motions about sliding on a few shapes, at many values of the numbers (src/README.md, section 12.1). Every
/// function is collective.
///
/// The shapes T come from modes of other points, without their motion along the normals of the pairs. W are responses
/// to a normal force on each pair. S = [T, W of the other pairs] is lifted by W of the closed rigid ones to what
/// contact allows, with the rows B_n and R of those:
///     S_Z = S - W (B_n W)^-1 B_n S,   S_Y = S - W (R W)^-1 R S,   (lambda^2 S_Y'M S_Z + ...) y = 0
/// Closed pairs with a compliance are springs.
#include "squeal/algebra/multivector.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"

namespace squeal
{

/// S_Y'M S_Z, S_Y'(C + G + C_f) S_Z, S_Y'(K + H + B'S B) S_Z, and K_loss, empty without loss factors. C is without the
/// viscous equivalent of loss factors.
struct ReducedMatrices
{
  Eigen::MatrixXd M{}, C{}, K{}, K_loss{};
  Eigen::Index common = 0; // shapes of T, which come first
};

/// Responses of K + omega^2 M to a normal force on each pair, of energy 1.
MultiVector make_pair_shapes(const BrakeModel& model, double omega);

/// Shapes that grow while modes bring more than `truncation` of their energy that is new.
class ShapeCollection
{
public:
  /// `pairs`: responses to the forces of the pairs; `omega`: of the energy x'(K + omega^2 M)x.
  ShapeCollection(const BrakeModel& model, const MultiVector& pairs, double omega);

  /// The real parts of modes, then the imaginary ones.
  void add(MultiVector vectors, double truncation);

  const MultiVector& shapes() const { return shapes_; }

private:
  void take_normal_motion_off(MultiVector& vectors) const;

  const MultiVector& pairs_;
  Owned<Mat> energy_, normals_; // B_n of all pairs
  MultiVector shapes_;          // orthonormal in energy
  MultiVector images_;          // energy times shapes
};

/// The matrices of a point on shapes T, with the responses W to the forces of its pairs. Error: friction jams a closed
/// pair.
ReducedMatrices reduced_matrices(const SlidingEquilibrium& sliding, const MultiVector& T, const MultiVector& W);

} // namespace squeal
