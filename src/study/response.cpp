#include "squeal/study/response.hpp"

#include "point_modes.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/base/run_control.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/LU>
#include <numeric>

namespace squeal
{

namespace
{

using Eigen::MatrixXcd;

constexpr double variance = 1. / 3;   // of the random vectors' entries, even in (-1, 1)
constexpr double least_error = 1e-14; // backward error that no correction makes smaller
constexpr double deep = 1e-4;         // part of the largest |H| at a frequency; below it errors are relative to this

/// The forces of a side: at the driven probes, Y'p, those of right vectors; at the read ones, Z'p, those of left ones.
struct UnitForces
{
  MultiVector columns;       // on the kept degrees of freedom
  std::vector<double> sizes; // of p
};

UnitForces unit_forces(Mat probes, const std::vector<int>& rows, Mat basis)
{
  const MultiVector all = dense_columns(transpose_of(probes)), p{all.comm, all.entries(Eigen::all, rows)};
  const Eigen::VectorXd sizes = column_norms(p);
  return {product(transpose_of(basis), p), {sizes.begin(), sizes.end()}};
}

/// The equations of section 13.1 and their transposes, with the basis of both kinds of solutions.
struct ForcedPoint
{
  LinearisedPoint point;
  std::array<UnitForces, 2> forces; // by sides
  ModesBasis modes;
  ProjectedSliding projected{};
  std::array<MatrixXd, 2> on_basis{}; // of each side: products with the basis, those of the random vectors first

  Index size() const { return modes.basis.shapes(); }
};

ForcedPoint make_forced_point(const ResponseProblem& problem, LinearisedPoint point)
{
  const auto& [structure, interface, equilibrium] = problem.sliding;
  std::vector<int> all(static_cast<std::size_t>(row_count(problem.probes)));
  std::iota(all.begin(), all.end(), 0);
  std::array forces{unit_forces(problem.probes, problem.excitations, point.contact.Y),
                    unit_forces(problem.probes, all, point.contact.Z)};
  const std::vector<char>& closed = equilibrium.closed;
  return {std::move(point), std::move(forces),
          make_modes_basis({structure, interface, closed, problem.frequency_hz.back(), problem.modes_options}, closed)};
}

/// Puts the equations on the basis as it is.
void project(ForcedPoint& forced)
{
  forced.projected = project(forced.modes.basis, forced.point);
  const MultiVector kept = kept_rows(forced.modes.basis.T, forced.point.contact);
  for (const std::size_t side : {0, 1}) forced.on_basis[side] = inner_products(kept, forced.forces[side].columns);
}

/// Solutions of both sides at a frequency on the basis, and what they leave over on its random vectors.
struct HarmonicSolution
{
  std::array<MatrixXcd, 2> a{}, left_over{}; // a column a force
};

HarmonicSolution solve_at(double omega, const ForcedPoint& forced)
{
  const Index size = forced.size(), sketches = forced.modes.basis.sketched;
  const auto& [M, C, K, K_loss] = forced.projected;
  const MatrixXcd Q = sum({M, C, K, K_loss}, loss_factors({0, omega}));
  const auto& [driven, read] = forced.on_basis;
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
  MatrixXcd receptance;                // H: rows of what is read within what is driven
  std::array<MatrixXd, 2> residuals{}; // of each side's forces, over the unit force
  std::array<MatrixXd, 2> defects{};   // the same over what is allowed
};

/// The geometric mean, at each frequency, of the largest value of either side.
Eigen::RowVectorXd means_of(const std::array<MatrixXd, 2>& sides)
{
  const Eigen::RowVectorXd right = sides[0].colwise().maxCoeff();
  return right.cwiseProduct(sides[1].colwise().maxCoeff()).cwiseSqrt();
}

bool is_small(const HarmonicScan& found)
{
  return means_of(found.defects).maxCoeff() <= 1;
}

/// Each rank solves frequencies of its own; all have the result. `tolerance`: residual allowed; rounding is allowed in
/// any case. Collective.
HarmonicScan scan(const ForcedPoint& forced, const std::vector<double>& omega, double tolerance)
{
  const auto count = static_cast<Index>(omega.size());
  const auto rows = [&](std::size_t side) { return std::ssize(forced.forces[side].sizes); };
  HarmonicScan result{MatrixXcd::Zero(rows(0) * rows(1), count)};
  for (const std::size_t side : {0, 1})
    result.residuals[side] = result.defects[side] = MatrixXd::Zero(rows(side), count);
  const MPI_Comm comm = forced.modes.basis.T.comm;
  for (Index f = rank_of(comm); f < count; f += ranks_of(comm))
  {
    const double at = omega[static_cast<std::size_t>(f)];
    const HarmonicSolution solution = solve_at(at, forced);
    result.receptance.col(f) = (forced.on_basis[1].bottomRows(forced.size()).transpose() * solution.a[0]).reshaped();
    for (const std::size_t side : {0, 1})
      for (Index force = 0; force < rows(side); ++force)
      {
        const double unit = forced.forces[side].sizes[static_cast<std::size_t>(force)],
                     sketches = static_cast<double>(forced.modes.basis.sketched),
                     residual = solution.left_over[side].col(force).norm() / std::sqrt(variance * sketches) / unit,
                     rounding =
                         least_error * scale_of(forced.modes, {0, at}) * solution.a[side].col(force).norm() / unit;
        result.residuals[side](force, f) = residual;
        result.defects[side](force, f) = residual / std::max(tolerance, rounding); // |T a| = |a|
      }
  }
  for (std::array<MatrixXd, 2>* sides : {&result.residuals, &result.defects})
    for (MatrixXd& part : *sides) // zeros but on one rank: the sums are exact
      MPI_Allreduce(MPI_IN_PLACE, part.data(), to_int(part.size()), MPI_DOUBLE, MPI_SUM, comm);
  MPI_Allreduce(MPI_IN_PLACE, result.receptance.data(), to_int(2 * result.receptance.size()), MPI_DOUBLE, MPI_SUM,
                comm);
  return result;
}

/// Corrects the basis by the residual of each force at the frequency where it is largest. Small ones are left out
/// unless all are small. Returns whether they add anything.
bool correct(ForcedPoint& forced, const std::vector<double>& omega, const HarmonicScan& found)
{
  const bool all_small = is_small(found);
  const LinearisedPoint& point = forced.point;
  MultiVector residuals{forced.modes.basis.T.comm, MatrixXd(forced.modes.basis.T.entries.rows(), 0)};
  for (const Side side : {Side::right, Side::left})
  {
    const auto which = static_cast<std::size_t>(side);
    const auto& [columns, sizes] = forced.forces[which];
    const Eigen::RowVectorXd of_other = found.defects[1 - which].colwise().maxCoeff();
    std::vector<Complex> lambda;
    MatrixXcd a(forced.size(), 0);
    MultiVector unit{columns.comm, MatrixXd(columns.entries.rows(), 0)};
    for (Index force = 0; force < columns.columns(); ++force)
    {
      Index worst = 0;
      if (found.defects[which].row(force).cwiseProduct(of_other).maxCoeff(&worst) <= 1 && !all_small) continue;
      const double at = omega[static_cast<std::size_t>(worst)], size = sizes[static_cast<std::size_t>(force)];
      lambda.emplace_back(0, at);
      a.conservativeResize(Eigen::NoChange, a.cols() + 1);
      a.rightCols(1) = solve_at(at, forced).a[which].col(force) / size;
      append(unit, {columns.comm, columns.entries.col(force) / size});
    }
    if (lambda.empty()) continue;
    const auto y = [&](const MatrixXcd& weights)
    { return kept_rows(combination_of_shapes(forced.modes.basis, (a * weights).real()), point.contact); };
    const MatrixXcd one = MatrixXcd::Identity(a.cols(), a.cols());
    MatrixXcd parts(a.cols(), 2 * a.cols()); // the real parts of all, then the imaginary parts
    parts << one, Complex(0, -1) * one;
    MultiVector left_over =
        dynamic_forces(forced.modes.basis, point, side, {Eigen::VectorXcd::Map(lambda.data(), a.cols()), parts, y});
    left_over.entries.leftCols(a.cols()) -= unit.entries;
    append(residuals, with_zero_pivots(left_over, point.contact));
  }
  return correct(forced.modes, std::move(residuals));
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

/// Corrects the basis until the residuals are small, once more after they first are, or no correction adds to it.
void solve(const ResponseProblem& problem, ForcedPoint& forced, Response& response)
{
  const auto& [tolerance, passes] = problem.options;
  std::vector<double> omega;
  for (const double frequency : problem.frequency_hz) omega.push_back(two_pi * frequency);
  const MPI_Comm comm = forced.modes.basis.T.comm;
  MultiVector start{comm, MatrixXd(forced.modes.basis.T.entries.rows(), 0)};
  for (const auto& [columns, sizes] : forced.forces) append(start, with_zero_pivots(columns, forced.point.contact));
  correct(forced.modes, std::move(start));
  Progress progress(comm, "response", passes);
  HarmonicScan found;
  MatrixXcd before; // H at all frequencies, without the last correction
  for (int pass = 0;; ++pass)
  {
    end_if_asked(comm);
    project(forced);
    found = scan(forced, omega, tolerance);
    bool ended = (is_small(found) && before.size() > 0) || pass >= passes;
    if (!ended) before = found.receptance;
    ended = ended || !correct(forced, omega, found);
    progress.update(pass, format("%d shapes", static_cast<int>(forced.size())));
    if (ended) break;
  }
  if (before.size() > 0) response.change = largest_change(before, found.receptance, std::ssize(forced.forces[1].sizes));
  response.outcome.residual = means_of(found.residuals).maxCoeff();
  if (!is_small(found)) response.outcome.kind = OutcomeKind::not_converged;
  response.shapes = static_cast<int>(forced.size());
  const std::size_t read = forced.forces[1].sizes.size();
  for (std::size_t driven = 0; driven < response.receptance.size(); ++driven)
    for (std::size_t probe = 0; probe < read; ++probe)
    {
      const auto row = found.receptance.row(static_cast<Index>(driven * read + probe));
      response.receptance[driven][probe].assign(row.begin(), row.end());
    }
}

} // namespace

Response find_response(const ResponseProblem& problem)
{
  Response response;
  response.outcome.kind = OutcomeKind::converged;
  response.frequency_hz = problem.frequency_hz;
  response.excitations = problem.excitations;
  LinearisedPoint point = linearise_point(problem.sliding);
  const std::vector<std::complex<double>> nothing(problem.frequency_hz.size());
  response.receptance.assign(problem.excitations.size(),
                             {static_cast<std::size_t>(row_count(problem.probes)), nothing});
  if (column_count(point.contact.Z) == 0)
    response.outcome.reason = "closed contact leaves nothing free to vibrate";
  else
  {
    ForcedPoint forced = make_forced_point(problem, std::move(point));
    solve(problem, forced, response);
  }
  if (response.outcome.kind == OutcomeKind::not_converged)
    response.outcome.reason = format("residuals up to %.1e of a unit force are left by a basis of %d shapes",
                                     response.outcome.residual, response.shapes);
  return response;
}

} // namespace squeal
