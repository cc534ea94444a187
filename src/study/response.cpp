#include "squeal/study/response.hpp"

#include "harmonic_basis.hpp"
#include "sliding_basis.hpp"
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/progress.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/modes/quadratic.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

constexpr std::size_t few = 48; // frequencies whose residuals are estimated before those of all are
constexpr double deep = 1e-4;   // part of the largest |H| at a frequency; below it errors are relative to this

/// The equations of section 3.4 and their transposes, with the forces of both sides.
struct Equations
{
  QuadraticProblem sliding;
  Owned<Mat> K_loss{};
  std::vector<Owned<Mat>> transposes{};
  HarmonicProblem harmonic{};

  std::vector<Mat> matrices() const
  {
    std::vector<Mat> list = {sliding.M, sliding.C, sliding.K};
    if (K_loss.get()) list.push_back(K_loss);
    return list;
  }
};

/// Unit forces at probes on the kept degrees of freedom: basis'p.
void append_forces(HarmonicSide& side, Mat probes, const std::vector<int>& rows, Mat basis)
{
  for (const int row : rows)
  {
    Owned<Vec> unit, force, kept;
    check(MatCreateVecs(probes, force.put(), unit.put()));
    check(MatCreateVecs(basis, kept.put(), nullptr));
    PetscInt first = 0, last = 0;
    check(VecGetOwnershipRange(unit, &first, &last));
    if (row >= first && row < last) check(VecSetValue(unit, row, 1, INSERT_VALUES));
    check(VecAssemblyBegin(unit));
    check(VecAssemblyEnd(unit));
    check(MatMultTranspose(probes, unit, force));
    check(MatMultTranspose(basis, force, kept));
    double size = 0;
    check(VecNorm(force, NORM_2, &size));
    append(side.forces, kept);
    side.sizes.push_back(size);
  }
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
  const ClosedContact& contact = problem.linearised.contact;
  Equations equations{sliding_problem(problem.structure, problem.linearised)};
  if (problem.structure.K_loss.get()) equations.K_loss = project(problem.structure.K_loss, contact.Y, contact.Z);
  HarmonicProblem& harmonic = equations.harmonic;
  harmonic.sides[0].matrices = equations.matrices();
  for (const Mat A : harmonic.sides[0].matrices)
  {
    equations.transposes.push_back(transpose_of(A));
    harmonic.sides[1].matrices.push_back(equations.transposes.back());
    check(MatNorm(A, NORM_1, &harmonic.norms.emplace_back()));
  }
  for (HarmonicSide& side : harmonic.sides) side.forces = empty_multivector(equations.sliding.K);
  append_forces(harmonic.sides[0], problem.probes, problem.excitations, contact.Y);
  append_forces(harmonic.sides[1], problem.probes, all_rows(problem.probes), contact.Z);
  return equations;
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
  const bool all_small = found.defects.maxCoeff() <= 1;
  const Index driven = basis.problem.of(ResponseEnd::driven).forces.columns();
  std::array<MultiVector, 2> residuals = {basis.V, basis.V};
  for (MultiVector& part : residuals) part.entries.resize(Eigen::NoChange, 0);
  for (Index force = 0; force < found.defects.rows(); ++force)
  {
    Index worst = 0;
    if (found.defects.row(force).maxCoeff(&worst) <= 1 && !all_small) continue;
    const ResponseEnd side = force < driven ? ResponseEnd::driven : ResponseEnd::read;
    append(residuals[static_cast<std::size_t>(side)],
           residual_at(basis, side, side == ResponseEnd::driven ? force : force - driven,
                       omega[static_cast<std::size_t>(worst)]));
  }
  MultiVector result = P.solve(residuals[0]);
  append(result, P.solve_transposed(residuals[1]));
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
std::optional<PartResponse> solve_part(const HarmonicProblem& problem, const std::vector<double>& omega,
                                       ShiftInvert& pencil, const ResponseOptions& options)
{
  HarmonicBasis basis = make_harmonic_basis(problem);
  move_to(pencil, (omega.front() * omega.front() + omega.back() * omega.back()) / 2);
  MultiVector start = pencil.factor->solve(problem.sides[0].forces);
  append(start, pencil.factor->solve_transposed(problem.sides[1].forces));
  extend(basis, std::move(start));
  for (Index before = 0;;)
  {
    end_if_asked(basis.V.comm);
    std::vector<double> at = thinned(omega, few);
    HarmonicScan found = scan(basis, at, basis.size(), options.tolerance);
    if (found.defects.maxCoeff() <= 1 && at.size() < omega.size())
    {
      at = omega;
      found = scan(basis, at, basis.size(), options.tolerance);
    }
    const bool small = found.defects.maxCoeff() <= 1, large = basis.size() > options.shapes;
    if (!small && large && omega.size() > 1) return std::nullopt;
    const Index size = basis.size();
    bool ended = (small && before > 0) || (large && basis.size() > 2 * options.shapes);
    if (!ended)
    {
      ended = extend(basis, corrections(basis, at, found, *pencil.factor)) == 0;
      if (!ended || before == 0) before = size;
    }
    if (!ended) continue;
    if (at.size() < omega.size()) found = scan(basis, omega, basis.size(), options.tolerance);
    return PartResponse{found, scan(basis, omega, before, options.tolerance).receptance, basis.size()};
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
    const auto solved = solve_part(equations.harmonic, omega, pencil, problem.options);
    if (!solved)
    {
      const std::size_t middle = (part.first + part.end) / 2;
      parts.insert(parts.end(), {Part{middle, part.end}, Part{part.first, middle}});
      continue;
    }
    const auto& [found, before, shapes] = *solved;
    store(found.receptance, part.first, response);
    response.change =
        std::max(response.change,
                 largest_change(before, found.receptance, equations.harmonic.of(ResponseEnd::read).forces.columns()));
    response.outcome.residual = std::max(response.outcome.residual, found.residuals.maxCoeff());
    if (found.defects.maxCoeff() > 1) response.outcome.kind = OutcomeKind::not_converged;
    response.parts += 1;
    response.shapes = std::max(response.shapes, static_cast<int>(shapes));
    progress.update(static_cast<double>(part.end), format("%d shapes", static_cast<int>(shapes)));
  }
}

} // namespace

OptionList options_of(ResponseOptions& options)
{
  return {
      {"-response_tolerance", &options.tolerance, Range::positive, "residuals of the responses, over a unit force"},
      {"-response_shapes", &options.shapes, Range::natural, "of a basis; where more are needed the band is parted"},
  };
}

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
    response.outcome.reason = format(
        "residuals up to %.1e of a unit force are left: a larger -response_shapes may help", response.outcome.residual);
  return response;
}

} // namespace squeal
