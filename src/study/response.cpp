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

Equations make_equations(const ResponseProblem& problem)
{
  Equations equations{linearise_point(problem.sliding), sliding_problem(problem.sliding.structure, problem.linearised)};
  const ClosedContact& contact = equations.point.contact;
  equations.norms = norms_of(equations.sliding);
  equations.forces = {unit_forces(problem.probes, problem.excitations, contact.Y),
                      unit_forces(problem.probes, all_rows(problem.probes), contact.Z)};
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

/// Solutions of both sides at a frequency on a basis, and what they leave over on its random vectors.
struct HarmonicSolution
{
  std::array<MatrixXcd, 2> a{}, left_over{}; // a column a force
};

HarmonicSolution solve_at(double omega, const HarmonicBasis& basis)
{
  const Index size = basis.size();
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

/// Each rank solves frequencies of its own; all have the result. `tolerance`: residual allowed; rounding is allowed in
/// any case. Collective.
HarmonicScan scan(const HarmonicBasis& basis, const std::vector<double>& omega, double tolerance)
{
  const auto count = static_cast<Index>(omega.size());
  const Equations& equations = basis.equations;
  const Index b = equations.of(Side::right).columns.columns(), c = equations.of(Side::left).columns.columns();
  HarmonicScan result{MatrixXcd::Zero(b * c, count), MatrixXd::Zero(b + c, count), MatrixXd::Zero(b + c, count), b};
  const MPI_Comm comm = basis.on.T.comm;
  for (Index f = rank_of(comm); f < count; f += ranks_of(comm))
  {
    const double at = omega[static_cast<std::size_t>(f)];
    const HarmonicSolution solution = solve_at(at, basis);
    result.receptance.col(f) = (basis.forces[1].bottomRows(basis.size()).transpose() * solution.a[0]).reshaped();
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

/// Evenly spread frequencies, at most `most`.
std::vector<double> thinned(const std::vector<double>& omega, std::size_t most)
{
  const std::size_t taken = std::min(most, omega.size());
  std::vector<double> result;
  for (std::size_t i = 0; i < taken; ++i) result.push_back(omega[i * omega.size() / taken]);
  return result;
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
      a.rightCols(1) = solve_at(at, basis).a[which].col(force);
    }
    if (forces.empty()) continue;
    const auto y = [&](const MatrixXcd& weights)
    { return kept_rows(combination_of_shapes(basis.on, (a * weights).real()), basis.equations.point.contact); };
    const MatrixXcd one = MatrixXcd::Identity(a.cols(), a.cols());
    MatrixXcd parts(a.cols(), 2 * a.cols()); // the real parts of all, then the imaginary parts
    parts << one, Complex(0, -1) * one;
    MultiVector residuals = dynamic_forces(basis.on, basis.equations.point, side,
                                           {Eigen::VectorXcd::Map(lambda.data(), a.cols()), parts, y});
    residuals.entries.leftCols(a.cols()) -= basis.equations.of(side).columns.entries(Eigen::all, forces);
    append(result, P.solve(residuals));
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

/// Extends a basis until its residuals are small, once more after they first are, or no correction adds to it. Nothing
/// where it would grow too large.
std::optional<PartResponse> solve_part(const Equations& equations, const std::vector<double>& omega,
                                       ShiftInvert& pencil, const ResponseOptions& options)
{
  const auto& [structure, interface, equilibrium] = equations.point.sliding;
  HarmonicBasis basis{equations, make_basis(structure, interface, sketches)};
  move_to(pencil, (omega.front() * omega.front() + omega.back() * omega.back()) / 2);
  MultiVector start = pencil.factor->solve(equations.of(Side::right).columns);
  append(start, pencil.factor->solve(equations.of(Side::left).columns));
  extend(basis, start);
  MatrixXcd before; // H at all frequencies of the part, without the last correction
  for (;;)
  {
    end_if_asked(basis.on.T.comm);
    const auto is_small = [](const HarmonicScan& found) { return found.means_of(found.defects).maxCoeff() <= 1; };
    std::vector<double> at = thinned(omega, few);
    HarmonicScan found = scan(basis, at, options.tolerance);
    if (is_small(found) && at.size() < omega.size()) found = scan(basis, at = omega, options.tolerance);
    const bool small = is_small(found), whole = at.size() == omega.size();
    if (!small && basis.size() > options.shapes && omega.size() > 1) return std::nullopt;
    bool ended = (small && before.size() > 0) || basis.size() > 2 * options.shapes;
    if (!ended && whole) before = found.receptance;
    ended = ended || extend(basis, corrections(basis, at, found, *pencil.factor)) == 0;
    if (!ended) continue;
    if (!whole) found = scan(basis, omega, options.tolerance);
    if (before.size() == 0) before = found.receptance;
    return PartResponse{found, before, basis.size()};
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
  ShiftInvert pencil = make_shift_invert(problem.linearised.K_z, problem.linearised.M_z, Keep::factor, problem.pencil);
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
