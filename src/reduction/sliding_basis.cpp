#include "squeal/reduction/sliding_basis.hpp"

#include "squeal/base/petsc.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/modes/quadratic.hpp"

#include <algorithm>
#include <ranges>

namespace squeal
{

namespace
{

/// The local rows of the degrees of freedom at which some row of B has an entry, ascending.
std::vector<Index> dofs_with_entries(Mat B)
{
  const auto [first, last] = own_columns(B);
  std::vector<PetscReal> largest(static_cast<std::size_t>(column_count(B)));
  check(MatGetColumnNorms(B, NORM_INFINITY, largest.data()));
  std::vector<Index> rows;
  for (PetscInt dof = first; dof < last; ++dof)
    if (largest[static_cast<std::size_t>(dof)] > 0) rows.push_back(dof - first);
  return rows;
}

/// Those of the matrices that there are.
std::vector<BasisImage*> images_of(SlidingBasis& basis)
{
  std::vector<BasisImage*> images;
  for (BasisImage* image : {&basis.M, &basis.C, &basis.K, &basis.K_loss, &basis.G, &basis.H})
    if (image->matrix.get()) images.push_back(image);
  return images;
}

/// `A` may be null.
void set_matrix(const SlidingBasis& basis, BasisImage& image, Mat A)
{
  if (image.matrix.get() == A) return;
  image = {image.sign};
  if (!A) return;
  image.matrix = shared(A);
  image.contact_rows = {basis.T.comm, MatrixXd(basis.contact_dofs.size(), basis.T.columns())};
  const auto take_rows = [&](Index first, const MultiVector& part)
  { image.contact_rows.entries.middleCols(first, part.columns()) = part.entries(basis.contact_dofs, Eigen::all); };
  image.products = symmetric_inner_products(basis.T, A, take_rows);
  if (image.sign < 0) image.products.triangularView<Eigen::StrictlyUpper>() = -image.products.transpose();
}

/// Other degrees of freedom of the contact need other rows of every image.
void set_contact(SlidingBasis& basis, Mat B)
{
  if (basis.B.get() == B) return;
  std::vector<Index> dofs = dofs_with_entries(B);
  int changed = dofs != basis.contact_dofs;
  MPI_Allreduce(MPI_IN_PLACE, &changed, 1, MPI_INT, MPI_MAX, comm_of(B));
  basis.B = shared(B);
  if (changed == 0) return;
  basis.contact_dofs = std::move(dofs);
  basis.whole_C = {};
  for (BasisImage* image : {&basis.M, &basis.C, &basis.K, &basis.K_loss, &basis.G, &basis.H}) image->matrix = {};
}

/// The pivots of this rank.
Owned<IS> pivot_set(const ClosedContact& contact)
{
  std::vector<PetscInt> own;
  for (const Index pivot : local_pivots(contact))
    own.push_back(own_rows(contact.Z).first + static_cast<PetscInt>(pivot));
  return set_of(comm_of(contact.Z), own);
}

/// Both lifts of a point.
struct Lifts
{
  Lift by_Z, by_Y;
  Owned<IS> pivots;
  std::vector<Index> in_contact{}; // places of the pivots among the contact's degrees of freedom
};

/// (T + D_Y)'A(T + D_Z); empty without a matrix.
MatrixXd lifted(const BasisImage& image, const Lifts& lifts)
{
  if (!image.matrix.get()) return {};
  const auto& [by_Z, by_Y, pivots, in_contact] = lifts;
  const MultiVector rows{by_Z.change.comm, image.contact_rows.entries(in_contact, Eigen::all)};
  MultiVector lifted_rows = product(part_of(image.matrix, pivots, pivots), by_Z.change);
  lifted_rows.entries += rows.entries;
  return image.products + image.sign * inner_products(rows, by_Z.change) + inner_products(by_Y.change, lifted_rows);
}

/// T_Y'B'D B T_Z
MatrixXd projected_on_pairs(const SlidingBasis& basis, const LinearisedPoint& point, const Lifts& lifts, Mat D)
{
  const Owned<Mat> B_pivots = at_pivots(basis.B, point.contact);
  const MultiVector motion = product(basis.B, basis.T);
  const auto lifted = [&](const MultiVector& change) {
    return MultiVector{change.comm, motion.entries + product(B_pivots, change).entries};
  };
  return inner_products(lifted(lifts.by_Y.change), product(D, lifted(lifts.by_Z.change)));
}

} // namespace

SlidingBasis make_basis(const Structure& structure, const Interface& interface, Index sketched)
{
  SlidingBasis basis{random_multivector(structure.K, static_cast<PetscInt>(sketched)), sketched};
  set_model(basis, structure, interface);
  return basis;
}

void set_model(SlidingBasis& basis, const Structure& structure, const Interface& interface)
{
  set_contact(basis, interface.B);
  set_matrix(basis, basis.M, structure.M);
  set_matrix(basis, basis.K, structure.K);
  if (basis.whole_C.get() != structure.C)
    set_matrix(basis, basis.C,
               structure.K_loss.get() ? without_loss(structure.C, structure) : shared(structure.C.get()));
  basis.whole_C = shared(structure.C.get());
  set_matrix(basis, basis.K_loss, structure.K_loss);
  set_matrix(basis, basis.G, structure.G);
  set_matrix(basis, basis.H, structure.H);
}

MultiVector combination_of_shapes(const SlidingBasis& basis, const MatrixXd& a)
{
  return {basis.T.comm, basis.T.entries.middleCols(basis.sketched, a.rows()) * a};
}

Index extend(SlidingBasis& basis, MultiVector X)
{
  MultiVector shapes = columns_from(basis.T, basis.sketched);
  const Index gained = extend_orthonormal(shapes, std::move(X)), size = basis.T.columns() + gained;
  if (gained == 0) return 0;
  const MultiVector news = columns_from(shapes, shapes.columns() - gained);
  append(basis.T, news);
  for (BasisImage* image : images_of(basis))
  {
    const MultiVector AX = product(image->matrix, news);
    append(image->contact_rows, {AX.comm, AX.entries(basis.contact_dofs, Eigen::all)});
    const MatrixXd inner = inner_products(basis.T, AX);
    image->products.conservativeResize(size, size);
    image->products.rightCols(gained) = inner;
    image->products.bottomRows(gained) = image->sign * inner.transpose();
  }
  return gained;
}

std::vector<Index> local_pivots(const ClosedContact& contact)
{
  const IndexRange own = own_rows(contact.Z);
  std::vector<Index> rows;
  for (const PetscInt pivot : contact.pivots)
    if (own.holds(pivot)) rows.push_back(pivot - own.first);
  return rows;
}

namespace
{

/// The rows of no pivot among so many local ones.
std::vector<Index> rows_kept(const ClosedContact& contact, Index rows)
{
  std::vector<Index> kept;
  std::ranges::set_difference(std::views::iota(Index{0}, rows), local_pivots(contact), std::back_inserter(kept));
  return kept;
}

} // namespace

LinearisedPoint linearise_point(const SlidingEquilibrium& sliding)
{
  const auto& [structure, interface, equilibrium] = sliding;
  LinearisedPoint point{sliding, eliminate_closed_pairs(structure, interface, equilibrium.closed)};
  const auto part = interface.friction.common.direction_damping ? FrictionDamping::whole : FrictionDamping::of_speed;
  point.damping = damping_of_pairs(interface, equilibrium.closed, equilibrium.reactions, part);
  point.stiffness = stiffness_of_pairs(interface, equilibrium.closed, PairForces::with_friction);
  return point;
}

Lift lift(const SlidingBasis& basis, const ClosedContact& contact, Mat by)
{
  const std::vector<Index> pivots = local_pivots(contact);
  // rows of pivots have entries at other degrees of freedom of the contact alone
  std::vector<Index> rows;
  std::vector<PetscInt> columns;
  const PetscInt first = own_columns(by).first;
  for (std::size_t below = 0; const Index dof : basis.contact_dofs)
  {
    while (below < pivots.size() && pivots[below] < dof) ++below;
    if (below < pivots.size() && pivots[below] == dof) continue;
    rows.push_back(dof);
    columns.push_back(first + static_cast<PetscInt>(dof) - static_cast<PetscInt>(below));
  }
  MultiVector change = product(part_of(by, pivot_set(contact), set_of(comm_of(by), columns)),
                               {basis.T.comm, basis.T.entries(rows, Eigen::all)});
  change.entries -= basis.T.entries(pivots, Eigen::all);
  return {pivots, std::move(change)};
}

Owned<Mat> at_pivots(Mat A, const ClosedContact& contact)
{
  return part_of(A, set_of(comm_of(A), own_rows(A)), pivot_set(contact));
}

ProjectedSliding project(const SlidingBasis& basis, const LinearisedPoint& point)
{
  const ClosedContact& contact = point.contact;
  Lifts lifts{lift(basis, contact, contact.Z), lift(basis, contact, contact.Y), pivot_set(contact)};
  for (const Index pivot : lifts.by_Z.pivots)
    lifts.in_contact.push_back(std::ranges::lower_bound(basis.contact_dofs, pivot) - basis.contact_dofs.begin());
  ProjectedSliding result{lifted(basis.M, lifts), lifted(basis.C, lifts), lifted(basis.K, lifts),
                          lifted(basis.K_loss, lifts)};
  if (basis.G.matrix.get()) result.C += lifted(basis.G, lifts);
  if (basis.H.matrix.get()) result.K += lifted(basis.H, lifts);
  if (point.damping.get()) result.C += projected_on_pairs(basis, point, lifts, point.damping);
  if (point.stiffness.get()) result.K += projected_on_pairs(basis, point, lifts, point.stiffness);
  return result;
}

MultiVector dynamic_forces(const SlidingBasis& basis, const LinearisedPoint& point, Side side, const Combinations& of)
{
  const auto& [structure, interface, equilibrium] = point.sliding;
  const bool right = side == Side::right;
  const double of_skew = right ? 1 : -1;
  const Mat lift = right ? point.contact.Z : point.contact.Y;
  const Owned<Mat> test = transpose_of(right ? point.contact.Y : point.contact.Z);
  const auto lifted = [&](const Eigen::MatrixXcd& weights) { return product(lift, of.y(weights)); };
  const auto on_pairs = [&](Mat D, const MultiVector& x)
  {
    const Owned<Mat> of_side = right ? copy_of(D) : transpose_of(D);
    return product(transpose_of(interface.B), product(of_side, product(interface.B, x)));
  };
  // lambda^2 M x + lambda C x + K x + f K_loss x, the factors within the weights
  const Eigen::MatrixXcd rates = of.lambda.asDiagonal() * of.weights;
  const MultiVector x = lifted(of.weights), v = lifted(rates);
  MultiVector force = product(structure.M, lifted(of.lambda.asDiagonal() * rates));
  const auto add = [&](double factor, const MultiVector& part) { force.entries += factor * part.entries; };
  add(1, product(basis.C.matrix, v));
  add(1, product(structure.K, x));
  if (structure.K_loss.get())
    add(1, product(structure.K_loss, lifted(of.lambda.unaryExpr(&loss_factor_of).asDiagonal() * of.weights)));
  if (structure.G.get()) add(of_skew, product(structure.G, v));
  if (structure.H.get()) add(of_skew, product(structure.H, x));
  if (point.damping.get()) add(1, on_pairs(point.damping, v));
  if (point.stiffness.get()) add(1, on_pairs(point.stiffness, x));
  return product(test, force);
}

MultiVector dense_columns(Mat A)
{
  const IndexRange own = own_rows(A);
  MultiVector result{comm_of(A), MatrixXd::Zero(own.size(), column_count(A))};
  for_each_row(A,
               [&](PetscInt row, std::span<const PetscInt> places, std::span<const PetscScalar> values)
               {
                 for (std::size_t k = 0; k < places.size(); ++k) result.entries(row - own.first, places[k]) = values[k];
               });
  return result;
}

MultiVector kept_rows(const MultiVector& x, const ClosedContact& contact)
{
  return {x.comm, x.entries(rows_kept(contact, x.entries.rows()), Eigen::all)};
}

MultiVector with_zero_pivots(const MultiVector& kept, const ClosedContact& contact)
{
  const Index pivots = std::ssize(local_pivots(contact));
  MultiVector x{kept.comm, MatrixXd::Zero(kept.entries.rows() + pivots, kept.columns())};
  x.entries(rows_kept(contact, x.entries.rows()), Eigen::all) = kept.entries;
  return x;
}

} // namespace squeal
