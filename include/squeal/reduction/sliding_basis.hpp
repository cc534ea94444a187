#pragma once
/// The projection of small motions about sliding on shapes, for cycles, sweeps, samples and responses (src/README.md,
/// sections 7.1 and 10.2). One basis serves many equilibria of one structure.
///
/// The shapes T are kept in the structure's degrees of freedom. At a point with the bases Z and Y of its closed pairs,
/// T is lifted. Its pivots are replaced by what Z or Y gives from the other degrees of freedom. Lifts change the rows
/// of the pivots alone. So the projected matrices follow from T'A T and from the rows of A T at the contact:
///     (T + D_Y)'A(T + D_Z) = T'A T + D_Y'(A T) + (A'T)'D_Z + D_Y'A D_Z,   A' = A or -A
#include "squeal/algebra/multivector.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/solid/structure.hpp"

#include <functional>

namespace squeal
{

/// A symmetric or skew matrix on T.
struct BasisImage
{
  double sign = 1;            // A' = sign A
  Owned<Mat> matrix{};        // A, shared with the structure; null: there is none
  MultiVector contact_rows{}; // of A T, at the degrees of freedom of the contact that this rank has
  Eigen::MatrixXd products{}; // T'A T
};

/// The first columns of T are random vectors, `sketched` of them. They only test: the products with a residual show its
/// size.
struct SlidingBasis
{
  MultiVector T;
  Eigen::Index sketched = 0;
  Owned<Mat> B{};                           // shared with the interface
  std::vector<Eigen::Index> contact_dofs{}; // of B: local rows, ascending
  BasisImage M{}, C{}, K{}, K_loss{};       // C without the viscous equivalent of loss factors
  Owned<Mat> whole_C{};                     // the structure's, which C was taken from
  BasisImage G{-1}, H{-1};

  Eigen::Index shapes() const { return T.columns() - sketched; }
};

SlidingBasis make_basis(const Structure& structure, const Interface& interface, Eigen::Index sketched);

/// T a of the first shapes, as many as a has rows.
MultiVector combination_of_shapes(const SlidingBasis& basis, const Eigen::MatrixXd& a);

/// Appends what the shapes X add to the span. Returns the number of columns gained.
Eigen::Index extend(SlidingBasis& basis, MultiVector X);

/// Takes over the matrices of a model where they have changed.
void set_model(SlidingBasis& basis, const Structure& structure, const Interface& interface);

/// The structure at a point, on T: Y'M Z, Y'(C + G + C_f) Z, Y'(K + H + B'S B) Z.
struct ProjectedSliding
{
  Eigen::MatrixXd M{}, C{}, K{}, K_loss{}; // K_loss is empty without loss factors
};

/// An equilibrium with its closed pairs eliminated. On the rows of B are the damping of the friction direction and S of
/// pairs with a compliance; null where there is none.
struct LinearisedPoint
{
  SlidingEquilibrium sliding;
  ClosedContact contact;
  Owned<Mat> damping{}, stiffness{};
};

LinearisedPoint linearise_point(const SlidingEquilibrium& sliding);

ProjectedSliding project(const SlidingBasis& basis, const LinearisedPoint& point);

/// The pivots of this rank, as local rows.
std::vector<Eigen::Index> local_pivots(const ClosedContact& contact);

/// The change of T by a lift: the rows of the pivots that this rank has.
struct Lift
{
  std::vector<Eigen::Index> pivots{}; // local rows
  MultiVector change{};               // D_Z or D_Y
};

/// `by`: Z or Y of the closed pairs.
Lift lift(const SlidingBasis& basis, const ClosedContact& contact, Mat by);

/// A at the columns of the pivots.
Owned<Mat> at_pivots(Mat A, const ClosedContact& contact);

/// Vectors of the problem, Q(lambda) right = 0, or of its transpose.
enum class Side
{
  right,
  left,
};

/// Vectors y_k of a side and their lambda_k, in combinations of which the real parts are taken: a column of weights w
/// each.
struct Combinations
{
  const Eigen::VectorXcd& lambda;
  const Eigen::MatrixXcd& weights;
  /// The real parts of the sums of w_k y_k for any weights, at the degrees of freedom that are no pivots.
  std::function<MultiVector(const Eigen::MatrixXcd& weights)> y;
};

/// The real parts of the sums of w_k Y'Q(lambda_k) Z y_k; of the left side those of w_k Z'Q(lambda_k)'Y y_k.
MultiVector dynamic_forces(const SlidingBasis& basis, const LinearisedPoint& point, Side side, const Combinations& of);

/// The columns of a sparse matrix.
MultiVector dense_columns(Mat A);

/// The degrees of freedom of x that are no pivots.
MultiVector kept_rows(const MultiVector& x, const ClosedContact& contact);

/// The reverse, with zeros at the pivots.
MultiVector with_zero_pivots(const MultiVector& kept, const ClosedContact& contact);

} // namespace squeal
