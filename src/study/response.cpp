#include "squeal/study/response.hpp"

#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/modes/dense_losses.hpp"
#include "squeal/modes/quadratic.hpp"
#include "squeal/reduction/sliding_basis.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/LU>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

constexpr Index sketches = 32;        // random vectors: a norm is off by 13 % (one standard deviation)
constexpr double variance = 1. / 3;   // of their entries, even in (-1, 1)
constexpr double least_error = 1e-14; // backward error that no correction makes smaller
constexpr std::size_t few = 16;       // frequencies whose residuals are estimated before those of all are
constexpr double deep = 1e-4;         // part of the largest |H| at a frequency; below it errors are relative to this
constexpr double negligible = 1e-3;   // part of a mode's shape that a basis does not start with

/// Modes of the equilibrium on the kept degrees of freedom.
struct KnownModes
{
  std::vector<Complex> lambda; // [1/s]
  MultiVector shapes;          // of norm 1, real and imaginary part of each
};

/// The forces of a side: at the driven probes, Y'p, those of right vectors; at the read ones, Z'p, those of left ones.
struct UnitForces
{
  MultiVector columns;
  std::vector<double> sizes{}; // of p
};

/// The equations of section 13.1 and their transposes, with the forces of both sides.
struct Equations
{
  LinearisedPoint point;
  QuadraticProblem sliding;
  QuadraticNorms norms{};
  std::array<UnitForces, 2> forces{}; // by sides
  KnownModes modes{};

  const UnitForces& of(Side side) const { return forces[static_cast<std::size_t>(side)]; }
};

/// Unit forces at probes on the kept degrees of freedom: basis'p.
UnitForces unit_forces(Mat probes, const std::vector<int>& rows, Mat basis)
{
  const MultiVector all = dense_columns(transpose_of(probes)), p{all.comm, all.entries(Eigen::all, rows)};
  const Eigen::VectorXd sizes = column_norms(p);
  return {product(transpose_of(basis), p), {sizes.begin(), sizes.end()}};
}

std::vector<int> all_rows(Mat probes)
{
  PetscInt count = 0;
  check(MatGetSize(probes, &count, nullptr));
  std::vector<int> rows;
  for (PetscInt i = 0; i < count; ++i) rows.push_back(static_cast<int>(i));
  return rows;
}

/// The known modes that oscillate.
KnownModes known_modes(std::span<const ComplexMode> modes, const ClosedContact& contact)
{
  KnownModes known{{}, empty_multivector(contact.Z)};
  for (const ComplexMode& mode : modes)
  {
    if (!(mode.lambda.imag() > 0)) continue;
    MultiVector parts = kept_rows(columns_of(std::array{mode.real.get(), mode.imaginary.get()}), contact);
    parts.entries /= column_norms(parts).norm();
    append(known.shapes, parts);
    known.lambda.push_back(mode.lambda);
  }
  return known;
}

Equations make_equations(const ResponseProblem& problem)
{
  Equations equations{linearise_point(problem.sliding), sliding_problem(problem.sliding.structure, problem.linearised)};
  const ClosedContact& contact = equations.point.contact;
  equations.norms = norms_of(equations.sliding);
  equations.forces = {unit_forces(problem.probes, problem.excitations, contact.Y),
                      unit_forces(problem.probes, all_rows(problem.probes), contact.Z)};
  equations.modes = known_modes(problem.modes, contact);
  return equations;
}

/// A basis of both kinds of solutions, with what it makes of the equations.
struct HarmonicBasis
{
  const Equations& equations;
  SlidingBasis on;
  ProjectedSliding projected{};
  std::array<MatrixXd, 2> forces{}; // of each side: products with the basis, those of the random vectors first

  Index size() const { return on.shapes(); }
};

/// Appends what X adds to the span. Returns the number of shapes gained. Collective.
Index extend(HarmonicBasis& basis, const MultiVector& X)
{
  const LinearisedPoint& point = basis.equations.point;
  const Index gained = extend(basis.on, product(point.contact.Z, X));
  if (gained == 0) return 0;
  basis.projected = project(basis.on, point);
  const MultiVector kept = kept_rows(basis.on.T, point.contact);
  for (const Side side : {Side::right, Side::left})
    basis.forces[static_cast<std::size_t>(side)] = inner_products(kept, basis.equations.of(side).columns);
  return gained;
}

/// Solutions of both sides at a frequency, on the first shapes of a basis, and what they leave over on its random
/// vectors.
struct HarmonicSolution
{
  std::array<MatrixXcd, 2> a{}, left_over{}; // a column a force
};

HarmonicSolution solve_at(double omega, const HarmonicBasis& basis, Index size)
{
  const auto& [M, C, K, K_loss] = basis.projected;
  const MatrixXcd Q = sum({M, C, K, K_loss}, loss_factors({0, omega}));
  const auto& [driven, read] = basis.forces;
  const Eigen::PartialPivLU<MatrixXcd> inverse(Q.block(sketches, sketches, size, size));
  HarmonicSolution solution;
  auto& [a, d] = solution.a;
  a = inverse.solve(driven.middleRows(sketches, size).cast<Complex>());
  d = inverse.transpose().solve(read.middleRows(sketches, size).cast<Complex>());
  solution.left_over = {Q.block(0, sketches, sketches, size) * a - driven.topRows(sketches).cast<Complex>(),
                        Q.block(sketches, 0, size, sketches).transpose() * d - read.topRows(sketches).cast<Complex>()};
  return solution;
}

/// Responses on the basis at a list of frequencies, one a column.
struct HarmonicScan
{
  MatrixXcd receptance; // H: rows of what is read within what is driven
  MatrixXd residuals;   // of all driven forces, then of all that are read, over the unit force
  MatrixXd defects;     // the same over what is allowed
  Index driven = 0;     // number of forces, the first rows of both

  /// The geometric mean, at each frequency, of the largest value of either side.
  Eigen::RowVectorXd means_of(const MatrixXd& rows) const
  {
    const Eigen::RowVectorXd largest = rows.topRows(driven).colwise().maxCoeff();
    return largest.cwiseProduct(rows.bottomRows(rows.rows() - driven).colwise().maxCoeff()).cwiseSqrt();
  }
};

/// Each rank solves frequencies of its own; all have the result. `size`: the number of shapes taken, the first ones.
/// `tolerance`: residual allowed; rounding is allowed in any case. Collective.
HarmonicScan scan(const HarmonicBasis& basis, const std::vector<double>& omega, Index size, double tolerance)
{
  const auto count = static_cast<Index>(omega.size());
  const Equations& equations = basis.equations;
  const Index b = equations.of(Side::right).columns.columns(), c = equations.of(Side::left).columns.columns();
  HarmonicScan result{MatrixXcd::Zero(b * c, count), MatrixXd::Zero(b + c, count), MatrixXd::Zero(b + c, count), b};
  const MPI_Comm comm = basis.on.T.comm;
  for (Index f = rank_of(comm); f < count; f += ranks_of(comm))
  {
    const double at = omega[static_cast<std::size_t>(f)];
    const HarmonicSolution solution = solve_at(at, basis, size);
    result.receptance.col(f) = (basis.forces[1].middleRows(sketches, size).transpose() * solution.a[0]).reshaped();
    const double scale = at * (at * equations.norms.M + equations.norms.C) + equations.norms.K;
    for (Index row = 0; row < b + c; ++row)
    {
      const std::size_t side = row < b ? 0 : 1;
      const Index force = row < b ? row : row - b;
      const double size_of_force = equations.forces[side].sizes[static_cast<std::size_t>(force)];
      result.residuals(row, f) =
          solution.left_over[side].col(force).norm() / std::sqrt(variance * sketches) / size_of_force;
      const double allowed = least_error * scale * solution.a[side].col(force).norm() / size_of_force; // |T a| = |a|
      result.defects(row, f) = result.residuals(row, f) / std::max(tolerance, allowed);
    }
  }
  for (MatrixXd* part : {&result.residuals, &result.defects}) // zeros but on one rank: the sums are exact
    MPI_Allreduce(MPI_IN_PLACE, part->data(), to_int(part->size()), MPI_DOUBLE, MPI_SUM, comm);
  MPI_Allreduce(MPI_IN_PLACE, result.receptance.data(), to_int(2 * result.receptance.size()), MPI_DOUBLE, MPI_SUM,
                comm);
  return result;
}

/// Q(lambda_k) y_k of both parts of each vector: the real parts of all, then the imaginary ones. Collective.
MultiVector dynamic_images(const HarmonicBasis& basis, Side side, const Eigen::VectorXcd& lambda,
                           const std::function<MultiVector(const MatrixXcd& weights)>& y)
{
  const MatrixXcd one = MatrixXcd::Identity(lambda.size(), lambda.size());
  MatrixXcd weights(one.rows(), 2 * one.cols());
  weights << one, Complex(0, -1) * one;
  return dynamic_forces(basis.on, basis.equations.point, side, {lambda, weights, y});
}

/// Evenly spread frequencies, at most `most`.
std::vector<double> thinned(const std::vector<double>& omega, std::size_t most)
{
  const std::size_t taken = std::min(most, omega.size());
  std::vector<double> result;
  for (std::size_t i = 0; i < taken; ++i) result.push_back(omega[i * omega.size() / taken]);
  return result;
}

/// The known modes between these frequencies, or at most half their distance beyond.
std::vector<Index> modes_near(const KnownModes& modes, double from, double to)
{
  std::vector<Index> near;
  for (std::size_t i = 0; i < modes.lambda.size(); ++i)
    if (std::abs(modes.lambda[i].imag() - (from + to) / 2) <= to - from) near.push_back(static_cast<Index>(i));
  return near;
}

/// What modes add to a basis: their shapes phi, and for the transposed problem -P'^-1 Q(lambda)'phi, by which its modes
/// differ from them to first order in friction.
MultiVector shapes_of(const HarmonicBasis& basis, const std::vector<Index>& which, const PencilFactor& P)
{
  const KnownModes& modes = basis.equations.modes;
  MultiVector re = empty_multivector(basis.equations.sliding.K), im = re;
  Eigen::VectorXcd lambda(static_cast<Index>(which.size()));
  for (Index k = 0; k < lambda.size(); ++k)
  {
    const Index i = which[static_cast<std::size_t>(k)];
    lambda(k) = modes.lambda[static_cast<std::size_t>(i)];
    append(re, {re.comm, modes.shapes.entries.col(2 * i)});
    append(im, {im.comm, modes.shapes.entries.col(2 * i + 1)});
  }
  MultiVector shapes = re;
  append(shapes, im);
  if (which.empty()) return shapes;
  const auto phi = [&](const MatrixXcd& weights) {
    return MultiVector{re.comm, re.entries * weights.real() - im.entries * weights.imag()};
  };
  append(shapes, P.solve_transposed(dynamic_images(basis, Side::left, lambda, phi)));
  orthonormalise(shapes, negligible * negligible);
  return shapes;
}

/// P^-1 r of each force, at the frequency of its largest residual. Small ones are left out unless all are small.
MultiVector corrections(const HarmonicBasis& basis, const std::vector<double>& omega, const HarmonicScan& found,
                        const PencilFactor& P)
{
  const bool all_small = found.means_of(found.defects).maxCoeff() <= 1;
  const Index driven = found.driven, read = found.defects.rows() - driven;
  const std::array<Eigen::RowVectorXd, 2> largest = {found.defects.topRows(driven).colwise().maxCoeff(),
                                                     found.defects.bottomRows(read).colwise().maxCoeff()};
  MultiVector result = empty_multivector(basis.equations.sliding.K);
  for (const Side side : {Side::right, Side::left})
  {
    const auto which = static_cast<std::size_t>(side);
    const Index first = which == 0 ? 0 : driven, count = which == 0 ? driven : read;
    std::vector<Index> forces;
    std::vector<Complex> lambda;
    MatrixXcd a(basis.size(), 0);
    for (Index force = 0; force < count; ++force)
    {
      Index worst = 0;
      const Eigen::RowVectorXd squares = found.defects.row(first + force).cwiseProduct(largest[1 - which]);
      if (squares.maxCoeff(&worst) <= 1 && !all_small) continue;
      const double at = omega[static_cast<std::size_t>(worst)];
      forces.push_back(force);
      lambda.emplace_back(0, at);
      a.conservativeResize(Eigen::NoChange, a.cols() + 1);
      a.rightCols(1) = solve_at(at, basis, basis.size()).a[which].col(force);
    }
    if (forces.empty()) continue;
    const auto y = [&](const MatrixXcd& weights)
    { return kept_rows(combination_of_shapes(basis.on, (a * weights).real()), basis.equations.point.contact); };
    MultiVector residuals =
        dynamic_images(basis, side, Eigen::VectorXcd::Map(lambda.data(), static_cast<Index>(lambda.size())), y);
    residuals.entries.leftCols(a.cols()) -= basis.equations.of(side).columns.entries(Eigen::all, forces);
    append(result, side == Side::right ? P.solve(residuals) : P.solve_transposed(residuals));
  }
  return result;
}

/// What the basis of a part of the band gives at its frequencies.
struct PartResponse
{
  HarmonicScan found;
  MatrixXcd before; // H without the last correction
  Index shapes = 0;
};

/// Extends a basis until its residuals are small, or no correction adds to it. Nothing where it would grow too large.
std::optional<PartResponse> solve_part(const Equations& equations, const std::vector<double>& omega,
                                       ShiftInvert& pencil, const ResponseOptions& options)
{
  const std::vector<Index> near = modes_near(equations.modes, omega.front(), omega.back());
  if (3 * static_cast<Index>(near.size()) > options.shapes && omega.size() > 1) return std::nullopt;
  const auto& [structure, interface, equilibrium] = equations.point.sliding;
  HarmonicBasis basis{equations, make_basis(structure, interface, sketches)};
  move_to(pencil, (omega.front() * omega.front() + omega.back() * omega.back()) / 2);
  MultiVector start = pencil.factor->solve(equations.of(Side::right).columns);
  append(start, pencil.factor->solve_transposed(equations.of(Side::left).columns));
  append(start, shapes_of(basis, near, *pencil.factor));
  extend(basis, start);
  MatrixXcd earlier; // H at all frequencies of the part, on the first `before` shapes
  for (Index before = 0;;)
  {
    end_if_asked(basis.on.T.comm);
    std::vector<double> at = thinned(omega, few);
    HarmonicScan found = scan(basis, at, basis.size(), options.tolerance);
    if (found.means_of(found.defects).maxCoeff() <= 1 && at.size() < omega.size())
    {
      at = omega;
      found = scan(basis, at, basis.size(), options.tolerance);
    }
    const bool small = found.means_of(found.defects).maxCoeff() <= 1, large = basis.size() > options.shapes;
    if (!small && large && omega.size() > 1) return std::nullopt;
    const Index size = basis.size();
    bool ended = (small && before > 0) || (large && basis.size() > 2 * options.shapes);
    if (!ended)
    {
      ended = extend(basis, corrections(basis, at, found, *pencil.factor)) == 0;
      if (!ended || before == 0)
      {
        before = size;
        earlier = at.size() == omega.size() ? found.receptance : MatrixXcd();
      }
    }
    if (!ended) continue;
    if (at.size() < omega.size()) found = scan(basis, omega, basis.size(), options.tolerance);
    if (earlier.size() == 0) earlier = scan(basis, omega, before, options.tolerance).receptance;
    return PartResponse{found, earlier, basis.size()};
  }
}

/// The largest change of H from `coarse` to `fine`, over |H| or `deep` of the largest at the frequency.
double largest_change(const MatrixXcd& coarse, const MatrixXcd& fine, Index read)
{
  double largest = 0;
  for (Index f = 0; f < fine.cols(); ++f)
    for (Index first = 0; first < fine.rows(); first += read)
    {
      const Eigen::ArrayXd size = fine.col(f).segment(first, read).cwiseAbs();
      const Eigen::ArrayXd change = (fine - coarse).col(f).segment(first, read).cwiseAbs();
      const double floor = deep * size.maxCoeff();
      if (floor > 0) largest = std::max(largest, (change / size.max(floor)).maxCoeff());
    }
  return largest;
}

/// Takes over the responses at the frequencies from `first` on.
void store(const MatrixXcd& receptance, std::size_t first, Response& response)
{
  const std::size_t read = response.receptance.front().size();
  for (Index f = 0; f < receptance.cols(); ++f)
    for (Index row = 0; row < receptance.rows(); ++row)
      response.receptance[static_cast<std::size_t>(row) / read][static_cast<std::size_t>(row) % read]
                         [first + static_cast<std::size_t>(f)] = receptance(row, f);
}

/// A part of the frequencies, [first, end).
struct Part
{
  std::size_t first = 0, end = 0;
};

void solve_band(const ResponseProblem& problem, const Equations& equations, Response& response)
{
  const MPI_Comm comm = comm_of(equations.sliding.K);
  ShiftInvert pencil = make_shift_invert(equations.sliding.K, equations.sliding.M, Symmetry::none, problem.pencil);
  std::vector<Part> parts = {{0, problem.frequency_hz.size()}}; // those still to come, the lowest last
  Progress progress(comm, "response", static_cast<double>(problem.frequency_hz.size()));
  while (!parts.empty())
  {
    const Part part = parts.back();
    parts.pop_back();
    std::vector<double> omega;
    for (std::size_t f = part.first; f < part.end; ++f) omega.push_back(two_pi * problem.frequency_hz[f]);
    const auto solved = solve_part(equations, omega, pencil, problem.options);
    if (!solved)
    {
      const std::size_t middle = (part.first + part.end) / 2;
      parts.insert(parts.end(), {Part{middle, part.end}, Part{part.first, middle}});
      continue;
    }
    const auto& [found, before, shapes] = *solved;
    store(found.receptance, part.first, response);
    response.change =
        std::max(response.change, largest_change(before, found.receptance, equations.of(Side::left).columns.columns()));
    response.outcome.residual = std::max(response.outcome.residual, found.means_of(found.residuals).maxCoeff());
    if (found.means_of(found.defects).maxCoeff() > 1) response.outcome.kind = OutcomeKind::not_converged;
    response.parts += 1;
    response.shapes = std::max(response.shapes, static_cast<int>(shapes));
    progress.update(static_cast<double>(part.end), format("%d shapes", static_cast<int>(shapes)));
  }
}

} // namespace

Response find_response(const ResponseProblem& problem)
{
  Response response;
  response.outcome.kind = OutcomeKind::converged;
  response.frequency_hz = problem.frequency_hz;
  response.excitations = problem.excitations;
  PetscInt probes = 0, free = 0;
  check(MatGetSize(problem.probes, &probes, nullptr));
  check(MatGetSize(problem.linearised.K_z, &free, nullptr));
  const std::vector<std::complex<double>> nothing(problem.frequency_hz.size());
  response.receptance.assign(problem.excitations.size(), {static_cast<std::size_t>(probes), nothing});
  if (free == 0)
    response.outcome.reason = "closed contact leaves nothing free to vibrate";
  else
    solve_band(problem, make_equations(problem), response);
  if (response.outcome.kind == OutcomeKind::not_converged)
    response.outcome.reason = format("residuals up to %.1e of a unit force are left by a basis of %ld shapes",
                                     response.outcome.residual, static_cast<long>(problem.options.shapes));
  return response;
}

} // namespace squeal
