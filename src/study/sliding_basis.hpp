#pragma once
/// A basis for the modes of many sliding equilibria of one structure (src/README.md, section 10.2).
///
/// The shapes T are kept in the structure's degrees of freedom. At a point with the bases Z and Y of its closed pairs,
/// T is lifted. Its pivots are replaced by what Z or Y gives from the other degrees of freedom. Lifts change the rows
/// of the pivots alone. So the projected matrices follow from T'A T and from the rows of A T at the contact:
///     (T + D_Y)'A(T + D_Z) = T'A T + D_Y'(A T) + (A'T)'D_Z + D_Y'A D_Z,   A' = A or -A
#include "squeal/algebra/multivector.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/solid/structure.hpp"

namespace squeal
{

/// A symmetric or skew matrix on T.
struct BasisImage
{
  double sign = 1;                   // A' = sign A
  Owned<Mat> matrix{};               // A, shared with the structure; null: there is none
  MultiVector contact_rows{};        // of A T, at the degrees of freedom of the contact that this rank has
  Eigen::MatrixXd products{};        // T'A T
  MultiVector lifted_rows{};         // of A T_Z at the pivots, where T_Z is T lifted by Z
  Eigen::MatrixXd lifted_products{}; // T'A T_Z
};

/// The lift by Z, which stays while the closed pairs, T and the matrices do: friction changes Y alone.
struct LiftByZ
{
  Owned<Mat> Z;                           // a copy; null: to be made
  MultiVector change{};                   // D_Z, of the pivots' rows
  std::vector<Eigen::Index> pivots{};     // local rows
  std::vector<Eigen::Index> in_contact{}; // their places among the contact's degrees of freedom
  MultiVector of_B{};                     // B T
  Eigen::MatrixXd kept{};                 // inner products of the shapes without the pivots
  Eigen::MatrixXd independent{};          // combinations of shapes that stay so without the pivots; empty: all do
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
  std::optional<Rayleigh> rayleigh{};       // of C, whose image has then the matrix alone
  BasisImage G{-1}, H{-1};
  LiftByZ by_Z{};

  Eigen::Index shapes() const { return T.columns() - sketched; }
};

SlidingBasis make_basis(const Structure& structure, const Interface& interface, Eigen::Index sketched);

/// T a of the first shapes, as many as a has rows.
MultiVector combination_of_shapes(const SlidingBasis& basis, const Eigen::MatrixXd& a);

/// Appends what the shapes X add to the span. Returns the number of columns gained.
Eigen::Index extend(SlidingBasis& basis, MultiVector X);

/// Takes over the matrices of a model where they have changed.
void set_model(SlidingBasis& basis, const Structure& structure, const Interface& interface);

/// The structure at a point, on T: Y'M Z, Y'(C + G + C_f) Z, Y'(K + H + B'S B) Z, with the inner products and the
/// independent combinations of the lift.
struct ProjectedSliding
{
  Eigen::MatrixXd M{}, C{}, K{}, K_loss{}, kept{}, independent{}; // K_loss is empty without loss factors
};

/// `damping`, `stiffness`: of the friction direction and S of pairs with a compliance, on the rows of B; may be null.
ProjectedSliding project(SlidingBasis& basis, const ClosedContact& contact, Mat damping, Mat stiffness);

/// The degrees of freedom of x that are no pivots.
MultiVector kept_rows(const MultiVector& x, const ClosedContact& contact);

/// The reverse, with zeros at the pivots.
MultiVector with_zero_pivots(const MultiVector& kept, const ClosedContact& contact);

} // namespace squeal
