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
#include <map>

namespace squeal
{

namespace
{

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

constexpr std::size_t few = 16;     // frequencies whose residuals are estimated before those of all are
constexpr double deep = 1e-4;       // part of the largest |H| at a frequency; below it errors are relative to this
constexpr double negligible = 1e-3; // part of a mode's shape that a basis does not start with

/// Modes of the equilibrium on the kept degrees of freedom.
struct KnownModes
{
  std::vector<std::complex<double>> lambda; // [1/s]
  MultiVector shapes;                       // of norm 1, real and imaginary part of each
};

/// The equations of section 3.4 and their transposes, with the forces of both sides.
struct Equations
{
  QuadraticProblem sliding;
  Owned<Mat> K_loss{};
  std::vector<Owned<Mat>> transposes{};
  HarmonicProblem harmonic{};
  KnownModes modes{};

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

/// The known modes that oscillate, each turned in phase such that its real part is as large as can be.
KnownModes known_modes(const ResponseProblem& problem, Mat pattern)
{
  KnownModes known{{}, empty_multivector(pattern)};
  for (const ComplexMode& mode : problem.modes)
  {
    if (!(mode.lambda.imag() > 0)) continue;
    const MultiVector whole = columns_of(std::array{mode.real.get(), mode.imaginary.get()});
    MultiVector parts = kept_rows(whole, problem.linearised.contact);
    const MatrixXd products = inner_products(parts, parts);
    const double turn = -std::atan2(2 * products(0, 1), products(0, 0) - products(1, 1)) / 2;
    MatrixXd rotation(2, 2);
    rotation << std::cos(turn), std::sin(turn), -std::sin(turn), std::cos(turn);
    parts = combination(parts, rotation / std::sqrt(products.trace()));
    append(known.shapes, parts);
    known.lambda.push_back(mode.lambda);
  }
  return known;
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
  equations.modes = known_modes(problem, equations.sliding.K);
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
MultiVector shapes_of(const Equations& equations, const std::vector<Index>& which, const PencilFactor& P)
{
  MultiVector shapes = empty_multivector(equations.sliding.K), residuals = shapes;
  for (const Index i : which)
  {
    const MultiVector phi{shapes.comm, equations.modes.shapes.entries.middleCols(2 * i, 2)};
    append(shapes, phi);
    append(residuals, dynamic_image(equations.harmonic.of(ResponseEnd::read),
                                    equations.modes.lambda[static_cast<std::size_t>(i)], phi));
  }
  if (which.empty()) return shapes;
  append(shapes, P.solve_transposed(residuals));
  orthonormalise(shapes, negligible * negligible);
  return shapes;
}

/// P^-1 r of each force, at the frequency of its largest residual. Small ones are left out unless all are small.
MultiVector corrections(const HarmonicBasis& basis, const std::vector<double>& omega, const HarmonicScan& found,
                        const PencilFactor& P)
{
  const bool all_small = found.means_of(found.defects).maxCoeff() <= 1;
  const Index driven = found.driven;
  const Eigen::RowVectorXd of_driven = found.defects.topRows(driven).colwise().maxCoeff(),
                           of_read = found.defects.bottomRows(found.defects.rows() - driven).colwise().maxCoeff();
  const MultiVector none{basis.V.comm, MatrixXd(basis.V.entries.rows(), 0)};
  std::array<MultiVector, 2> residuals = {none, none};
  std::map<Index, std::array<MatrixXcd, 2>> solved; // by frequency
  for (Index force = 0; force < found.defects.rows(); ++force)
  {
    Index worst = 0;
    const Eigen::RowVectorXd squares = found.defects.row(force).cwiseProduct(force < driven ? of_read : of_driven);
    if (squares.maxCoeff(&worst) <= 1 && !all_small) continue;
    const ResponseEnd side = force < driven ? ResponseEnd::driven : ResponseEnd::read;
    const auto which = static_cast<std::size_t>(side);
    const Index own = side == ResponseEnd::driven ? force : force - driven;
    const double at = omega[static_cast<std::size_t>(worst)];
    if (!solved.contains(worst)) solved[worst] = solve_at(at, basis, basis.size());
    append(residuals[which], residual_of(basis, side, own, at, solved[worst][which].col(own)));
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
std::optional<PartResponse> solve_part(const Equations& equations, const std::vector<double>& omega,
                                       ShiftInvert& pencil, const ResponseOptions& options)
{
  const HarmonicProblem& problem = equations.harmonic;
  const std::vector<Index> near = modes_near(equations.modes, omega.front(), omega.back());
  if (3 * static_cast<Index>(near.size()) > options.shapes && omega.size() > 1) return std::nullopt;
  HarmonicBasis basis = make_harmonic_basis(problem);
  move_to(pencil, (omega.front() * omega.front() + omega.back() * omega.back()) / 2);
  MultiVector start = pencil.factor->solve(problem.sides[0].forces);
  append(start, pencil.factor->solve_transposed(problem.sides[1].forces));
  append(start, shapes_of(equations, near, *pencil.factor));
  extend(basis, std::move(start));
  MatrixXcd earlier; // H at all frequencies of the part, on the first `before` shapes
  for (Index before = 0;;)
  {
    end_if_asked(basis.V.comm);
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
        std::max(response.change,
                 largest_change(before, found.receptance, equations.harmonic.of(ResponseEnd::read).forces.columns()));
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
