#include "squeal/reduction/reduced_model.hpp"
#include "reduction_basis.hpp"
#include "squeal/algebra/sparse_matrices.hpp"
#include "squeal/base/free_memory.hpp"
#include "squeal/contact/contact_operator.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/reduction/sliding_basis.hpp"
#include "squeal/solid/structure.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace squeal
{

std::vector<int> pairs_that_may_change(const Interface& interface, const Equilibrium& equilibrium,
                                       const ComplexMode& mode, double amplitude)
{
  const std::vector<double> real = relative(interface, mode.real), imaginary = relative(interface, mode.imaginary);
  const std::vector<double> still = relative(interface, equilibrium.u);
  const auto normal = [&](const std::vector<double>& x, std::size_t pair)
  { return PairView(x, interface.directions).normal(pair); };
  std::vector<int> pairs;
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
  {
    const double gap = interface.gap[i] + normal(still, i);
    const bool changes = equilibrium.closed[i]
                             ? normal(equilibrium.reactions, i) < amplitude * std::abs(mode.reactions[i])
                             : gap < amplitude * std::hypot(normal(real, i), normal(imaginary, i));
    if (changes) pairs.push_back(static_cast<int>(i));
  }
  return pairs;
}

std::vector<int> pairs_that_may_turn(const Interface& interface, const ComplexMode& mode, double amplitude)
{
  const std::vector<double> real = relative(interface, mode.real), imaginary = relative(interface, mode.imaginary);
  std::vector<int> pairs;
  for (std::size_t i = 0; i < interface.gap.size(); ++i)
  {
    const double moves = std::hypot(length(PairView(real, interface.directions).tangential(i)),
                                    length(PairView(imaginary, interface.directions).tangential(i)));
    const double drive = drive_speed(interface, i);
    if (drive > 0 && amplitude * std::abs(mode.lambda) * moves >= drive) pairs.push_back(static_cast<int>(i));
  }
  return pairs;
}

std::vector<int> pairs_that_may_slip(const SlidingEquilibrium& sliding, const LinearisedSliding& linearised,
                                     const ComplexMode& mode, double amplitude)
{
  const auto& [structure, interface, equilibrium] = sliding;
  std::vector<int> pairs;
  if (!has_undriven_pairs(interface)) return pairs;
  const Mat K = linearised.K.get() ? linearised.K.get() : structure.K.get();
  const Owned<Vec> real = zeros_like(mode.real), imaginary = zeros_like(mode.real);
  quadratic_residual({structure.M, linearised.C, K}, mode.lambda, {mode.real, mode.imaginary}, {real, imaginary});
  std::vector<char> taken(interface.size(), 0); // rows that the mode holds
  const PairView<char> rows(taken, interface.directions);
  for (std::size_t i = 0; i < rows.pairs(); ++i)
  {
    if (!equilibrium.closed[i]) continue;
    rows.normal(i) = compliance_of(interface, i) == 0;
    std::ranges::fill(rows.tangential(i), is_undriven(interface, i) || rows.normal(i));
  }
  const std::vector<double> a = forces_on_rows(interface, taken, real), b = forces_on_rows(interface, taken, imaginary);
  const PairView first(a, interface.directions), second(b, interface.directions),
      still(equilibrium.reactions, interface.directions);
  for (std::size_t i = 0; i < rows.pairs(); ++i)
  {
    if (!is_undriven(interface, i) || !equilibrium.closed[i]) continue;
    const double mu = friction_coefficient(interface.friction.of(i), 0).value,
                 normal = amplitude * std::abs(mode.reactions[i]),
                 tangential = amplitude * std::hypot(length(first.tangential(i)), length(second.tangential(i)));
    if (length(still.tangential(i)) + tangential > mu * (still.normal(i) - normal))
      pairs.push_back(static_cast<int>(i));
  }
  return pairs;
}

namespace
{

Eigen::SparseMatrix<double> identity_of_rows(Mat A)
{
  Eigen::SparseMatrix<double> result(row_count(A), row_count(A));
  result.setIdentity();
  return result;
}

/// The pairs' normal rows of a matrix with all of their rows.
MatrixXd normal_rows(const MatrixXd& of_pairs, int directions)
{
  const PairRows<Index> rows(directions);
  MatrixXd result(of_pairs.rows() / rows.per_pair(), of_pairs.cols());
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = of_pairs.row(rows.normal(i));
  return result;
}

/// Law, gaps, reactions and drive of the active pairs; normal ones alone if they slide along the drive throughout. What
/// attachments left out of a pair's own compliance becomes one of the pair: more pairs may be closed than the shapes
/// can tell apart.
void set_active_pairs(ReducedModel& model, const Interface& interface, const Equilibrium& equilibrium, bool sliding)
{
  const std::vector<double> motion = relative(interface, equilibrium.u);
  const PairView still(motion, interface.directions), reactions(equilibrium.reactions, interface.directions);
  const TangentView drive(interface.drive, interface.directions);
  model.directions = sliding ? 0 : interface.directions;
  if (!sliding) model.friction = friction_of_some(interface.friction, model.active);
  for (const int pair : model.active)
  {
    const auto i = static_cast<std::size_t>(pair);
    const auto own = static_cast<Index>(model.compliance.size());
    const double c = compliance_of(interface, i) + (own < model.of_left_out.size() ? model.of_left_out(own) : 0);
    model.compliance.push_back(c);
    model.gap.push_back(equilibrium.closed[i] ? -c * reactions.normal(i) : interface.gap[i] + still.normal(i));
    model.reactions.push_back(reactions.normal(i));
    if (sliding) continue;
    for (const double friction : reactions.tangential(i)) model.reactions.push_back(friction);
    for (const double velocity : drive.of(i)) model.drive.push_back(velocity);
  }
}

/// Pairs by what they do in the motion that a model is made for.
struct ClosedPairs
{
  const std::vector<char>& sliding;     // closed throughout
  const std::vector<char>& follows;     // those whose friction follows their normal force
  const std::vector<double>& reactions; // [N] a contact vector
};

/// Sliding pairs taken out, with the springs of those that have a compliance and friction that turns.
LinearisedPoint without_sliding_pairs(const SlidingEquilibrium& sliding, const ClosedPairs& pairs)
{
  const auto& [structure, interface, equilibrium] = sliding;
  return {sliding, eliminate_closed_pairs(structure, interface, pairs.sliding),
          damping_of_pairs(interface, pairs.follows, pairs.reactions, FrictionDamping::whole),
          stiffness_of_pairs(interface, pairs.sliding, PairForces::with_friction)};
}

/// The structure with the viscous equivalent of loss factors in their place.
Structure viscous(const Structure& structure)
{
  Structure result;
  for (const auto matrix : {&Structure::M, &Structure::C, &Structure::K, &Structure::G})
    result.*matrix = shared((structure.*matrix).get());
  return result;
}

/// Sets M, C and K on the shapes X, tested by the left ones, and G and H of the active pairs' rows B.
void set_matrices(ReducedModel& model, const LinearisedPoint& point, MultiVector X, Mat B)
{
  SlidingBasis basis{std::move(X)};
  set_model(basis, viscous(point.sliding.structure), point.sliding.interface);
  const Lift left = lift(basis, point.contact, point.contact.Y); // what the left shapes have beyond the others
  ProjectedSliding projected = project(basis, point);
  model.M = std::move(projected.M);
  model.C = std::move(projected.C);
  model.K = std::move(projected.K);
  model.K_z = basis.K.products;
  model.C_z = basis.C.products;
  model.G = whole_product(B, basis.T);
  model.H = (model.G + whole_product(at_pivots(B, point.contact), left.change)).transpose();
  model.shapes = std::move(basis.T);
}

/// E = Z'(K + omega^2 M)Z, bordered by P.
Factor energy_factor(Mat K, Mat M, double omega, Mat Z, Mat P, const FactorOptions& options)
{
  const Owned<Mat> E = project_symmetric(K, Z);
  check(MatAXPY(E, omega * omega, project_symmetric(M, Z), UNKNOWN_NONZERO_PATTERN));
  check(MatSetOption(E, MAT_SYMMETRIC, PETSC_TRUE));
  Factor factor(E, P, options);
  if (factor.failed()) throw Error("reduced model: K + omega^2 M is not positive definite with the active pairs open");
  return factor;
}

/// The attachments asked for, as many as half of the free memory holds.
AttachmentLimits limits_of(const Reduction& reduction, const Structure& structure, Index modes)
{
  constexpr double most_lost = 0.1; // of compliance that no one chose to lose: 0.05 changes the cycle's energy by 4 %
  const double room =
      memory_for_shapes(free_memory(comm_of(structure.load))) / memory_of_reduction(entry_count(structure.load), 1);
  const auto fitting = static_cast<Index>(std::min<double>(room, all_attachments));
  const bool all = reduction.attachments == all_attachments;
  return {reduction.threshold, std::clamp<Index>(fitting - modes, 0, reduction.attachments), all ? most_lost : 1};
}

} // namespace

ReducedModel reduce(const SlidingEquilibrium& sliding, const std::vector<ComplexMode>& modes, std::vector<int> active,
                    const Reduction& reduction)
{
  PairRoles roles{std::move(active), sliding.equilibrium.closed, sliding.equilibrium.reactions};
  for (const int pair : roles.active) roles.sliding[static_cast<std::size_t>(pair)] = 0;
  return reduce(sliding, modes, roles, reduction);
}

ReducedModel reduce(const SlidingEquilibrium& sliding, const std::vector<ComplexMode>& modes, const PairRoles& roles,
                    const Reduction& reduction)
{
  const auto& [structure, interface, equilibrium] = sliding;
  const std::vector<int>& active = roles.active;
  ReducedModel model;
  std::vector<char> follows = roles.sliding; // pairs whose friction follows their normal force
  if (reduction.sliding)
    for (const int pair : active) follows[static_cast<std::size_t>(pair)] = 1; // no reaction while open
  const LinearisedPoint point = without_sliding_pairs(sliding, {roles.sliding, follows, roles.reactions});
  const ClosedContact& contact = point.contact;
  const double omega = modes.front().lambda.imag();

  // the modes, and what solves for the shapes of the pairs' forces
  const Owned<Mat> springs = contact_stiffness(interface, roles.sliding, PairForces::normal);
  const Owned<Mat> with_springs = springs.get() ? sum_of(structure.K, springs) : Owned<Mat>();
  const Mat K = with_springs.get() ? with_springs.get() : structure.K.get();
  const Owned<Mat> B = rows_of(interface, active, RowsTaken::all);
  Owned<Mat> BZ;
  check(MatMatMult(B, contact.Z, MAT_INITIAL_MATRIX, PETSC_DEFAULT, BZ.put()));
  Eigen::SparseMatrix<double> forces;
  if (reduction.sliding)
    forces = sliding_forces(interface, active);
  else
    forces = identity_of_rows(BZ);
  model.omega = omega;
  MultiVector X;
  {
    const MultiVector shapes = mode_columns(modes, reduction, contact);
    const Owned<Mat> P = force_rows(forces, BZ);
    const Factor factor = energy_factor(K, structure.M, omega, contact.Z, P, reduction.factor);
    const MatrixXd energy =
        symmetric_inner_products(shapes, K) + omega * omega * symmetric_inner_products(shapes, structure.M);
    X = make_basis(model, {factor, contact.Z, P}, shapes, energy, forces.transpose() * whole_product(B, shapes),
                   structure.M, limits_of(reduction, structure, shapes.columns()));
  }
  // Projected on the basis itself: a combination of what nearly parallel columns give would hold rounding alone.
  set_matrices(model, point, std::move(X), B);
  model.H = (model.H * forces).eval();
  if (reduction.sliding) model.G = normal_rows(model.G, interface.directions);
  model.E_factor.compute(model.K_z + omega * omega * model.M_z);
  model.M_factor.compute(model.M_z);
  if (model.M_factor.info() != Eigen::Success || model.E_factor.info() != Eigen::Success)
    throw Error("reduced model: a shape has no mass or no stiffness: give massless points a mass, or set "
                "fidelity = \"full\"");
  model.active = active;
  model.sliding = roles.sliding;
  if (!reduction.sliding) model.of_left_out = normal_rows(model.of_left_out, interface.directions);
  set_active_pairs(model, interface, equilibrium, reduction.sliding);
  model.force = -model.H * VectorXd::Map(model.reactions.data(), model.H.cols());
  return model;
}

ReducedState coordinates(const ReducedModel& model, const Structure& structure, Vec du, Vec v)
{
  const Owned<Vec> force = zeros_like(du), momentum = zeros_like(v);
  check(MatMult(structure.M, du, force));
  check(VecScale(force, model.omega * model.omega));
  check(MatMultAdd(structure.K, du, force, force));
  check(MatMult(structure.M, v, momentum));
  const MatrixXd seen = inner_products(model.shapes, columns_of(std::array{force.get(), momentum.get()}));
  return {model.E_factor.solve(seen.col(0)), model.M_factor.solve(seen.col(1))};
}

void add_motion(const ReducedModel& model, const ReducedState& state, Vec du, Vec v)
{
  MatrixXd coordinates(model.size(), 2);
  coordinates << state.q, state.v;
  const MatrixXd motion = model.shapes.entries * coordinates; // the shapes are read once for both
  Index column = 0;
  for (const Vec target : {du, v})
  {
    PetscScalar* entries = nullptr;
    check(VecGetArray(target, &entries));
    VectorXd::Map(entries, motion.rows()) += motion.col(column++);
    check(VecRestoreArray(target, &entries));
  }
}

} // namespace squeal
