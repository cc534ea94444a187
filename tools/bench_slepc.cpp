/// Times squeal's real modes and slices beside SLEPc's own solvers on one band of one scene, for tools/bench: one line
/// of JSON on standard output.
///     bench_slepc SCENE band rounds [key=value …]
/// All alternate in every round; figures are medians of processor seconds. SLEPc's factors are MUMPS's.
///     real modes: around one shift by squeal, beside spectrum slicing (EPSSetInterval);
///     quadratic:  TOAR, shift-inverted near zero, as modes.method = "toar" asks for it.
/// -bench_real_only leaves out all but the real modes.
/// -bench_write FOLDER writes M, C, K of the quadratic problem and the sizes |lambda| of its pairs, for another solver.
#include "bench_timing.hpp"
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/model.hpp"
#include "squeal/modes/modes.hpp"
#include "squeal/modes/real_modes.hpp"
#include "squeal/scene/scene.hpp"

#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>

using namespace squeal;

namespace
{

const ModesOptions large{.dense_limit = 0}; // the methods of large problems
using Figures = std::map<std::string, std::vector<double>>;

struct Problem
{
  QuadraticProblem quadratic;
  Owned<Mat> M, K; // symmetric, of the real modes
};

Problem read_problem(const char* file, const std::vector<std::string>& overrides)
{
  const Scene scene = read_scene(file, overrides);
  const Model model = build_model(scene, PETSC_COMM_WORLD);
  const Structure& structure = model.structure;
  const Equilibrium equilibrium = find_equilibrium(structure, model.interface, {});
  LinearisedSliding linearised = linearise({structure, model.interface, equilibrium});
  const Mat Y = linearised.contact.Y, Z = linearised.contact.Z;
  return {{project(structure.M, Y, Z), project(linearised.C, Y, Z), project(structure.K, Y, Z)},
          std::move(linearised.M_z),
          std::move(linearised.K_z)};
}

struct Answer
{
  int found = 0;
  double residual = 0, seconds = 0;
};

/// theta = omega^2 of real modes, and their shapes.
struct RealPairs
{
  std::vector<double> theta;
  std::vector<Owned<Vec>> x;
};

/// Largest |K x - theta M x| / (|K| |x|).
double largest_residual(const RealPairs& found, Mat M, Mat K)
{
  Owned<Vec> left, inertia;
  check(MatCreateVecs(K, left.put(), inertia.put()));
  double stiffness = 0, largest = 0;
  check(MatNorm(K, NORM_1, &stiffness));
  for (std::size_t i = 0; i < found.x.size(); ++i)
  {
    double residual = 0, size = 0;
    check(MatMult(K, found.x[i], left));
    check(MatMult(M, found.x[i], inertia));
    check(VecAXPY(left, -found.theta[i], inertia));
    check(VecNorm(left, NORM_2, &residual));
    check(VecNorm(found.x[i], NORM_2, &size));
    largest = std::max(largest, residual / (stiffness * size));
  }
  return largest;
}

/// Shift and inverse by MUMPS's L D L'.
void use_cholesky(ST transformation, KSP solver)
{
  PC factor = nullptr;
  check(STSetType(transformation, STSINVERT));
  check(KSPSetType(solver, KSPPREONLY));
  check(KSPGetPC(solver, &factor));
  check(PCSetType(factor, PCCHOLESKY));
  check(PCFactorSetMatSolverType(factor, MATSOLVERMUMPS));
}

/// Spectrum slicing: shifts of SLEPc's own, with `subspace` modes sought at each.
RealPairs modes_by_interval(const Problem& problem, double limit, PetscInt subspace)
{
  EPS eps = nullptr;
  ST transformation = nullptr;
  KSP solver = nullptr;
  check(EPSCreate(PETSC_COMM_WORLD, &eps));
  check(EPSSetOperators(eps, problem.K, problem.M));
  check(EPSSetProblemType(eps, EPS_GHEP));
  check(EPSSetType(eps, EPSKRYLOVSCHUR));
  check(EPSSetTolerances(eps, 1e-9, 200));
  check(EPSGetST(eps, &transformation));
  check(STSetType(transformation, STSINVERT));
  check(EPSSetWhichEigenpairs(eps, EPS_ALL));
  check(EPSSetInterval(eps, shift_below_zero(problem.M, problem.K), limit));
  check(EPSKrylovSchurSetDimensions(eps, subspace, 2 * subspace, 2 * subspace));
  check(EPSKrylovSchurGetKSP(eps, &solver));
  use_cholesky(transformation, solver);
  check(EPSSetOptionsPrefix(eps, "bench_"));
  check(EPSSetFromOptions(eps));
  check(EPSSolve(eps));
  PetscInt converged = 0;
  check(EPSGetConverged(eps, &converged));
  RealPairs found;
  for (PetscInt i = 0; i < converged; ++i)
  {
    found.theta.emplace_back();
    check(MatCreateVecs(problem.K, found.x.emplace_back().put(), nullptr));
    check(EPSGetEigenpair(eps, i, &found.theta.back(), nullptr, found.x.back(), nullptr));
  }
  check(EPSDestroy(&eps));
  return found;
}

Answer real_modes_by_slicing(const Problem& problem, double limit, PetscInt subspace)
{
  const double start = processor_time();
  const RealPairs found = modes_by_interval(problem, limit, subspace);
  return {static_cast<int>(found.theta.size()), largest_residual(found, problem.M, problem.K),
          processor_time() - start};
}

Answer real_modes_by_squeal(const Problem& problem, double band)
{
  const double start = processor_time();
  const RealModes modes = solve_real_modes_below(problem.M, problem.K, band, large);
  return {static_cast<int>(modes.omega.size()), modes.outcome.residual, processor_time() - start};
}

PairSearch search(const Problem& problem, ModesMethod method, double band)
{
  return search_pairs({problem.quadratic, nullptr, problem.M, problem.K}, method, band, large);
}

Answer pairs_by(ModesMethod method, const Problem& problem, double band)
{
  const double start = processor_time();
  const PairSearch result = search(problem, method, band);
  const double limit = two_pi * band;
  const auto& pairs = result.solution.pairs;
  return {static_cast<int>(std::count_if(pairs.begin(), pairs.end(),
                                         [&](const Eigenpair& p) { return std::abs(p.lambda) < limit; })),
          result.solution.outcome.residual, processor_time() - start};
}

/// K.petsc, C.petsc, M.petsc, and pairs.txt: |lambda| of the pairs, one a line, ascending.
void write_problem(const Problem& problem, double band, const std::filesystem::path& folder)
{
  for (const auto& [name, matrix] : {std::pair{"M.petsc", problem.quadratic.M.get()},
                                     {"C.petsc", problem.quadratic.C.get()},
                                     {"K.petsc", problem.quadratic.K.get()}})
  {
    Owned<PetscViewer> viewer;
    check(PetscViewerBinaryOpen(PETSC_COMM_WORLD, (folder / name).c_str(), FILE_MODE_WRITE, viewer.put()));
    check(MatView(matrix, viewer));
  }
  std::vector<double> sizes;
  for (const Eigenpair& pair : search(problem, ModesMethod::full, band).solution.pairs)
    if (std::abs(pair.lambda) < two_pi * band) sizes.push_back(std::abs(pair.lambda));
  std::sort(sizes.begin(), sizes.end());
  std::ofstream file(folder / "pairs.txt");
  file.precision(17);
  for (const double size : sizes) file << size << "\n";
}

void run(int argc, char** argv)
{
  if (argc < 4) throw Error("bench_slepc SCENE band rounds [key=value …]");
  std::vector<std::string> overrides;
  for (int i = 4; i < argc && argv[i][0] != '-'; ++i) overrides.emplace_back(argv[i]);
  const double band = std::stod(argv[2]), omega = two_pi * band;
  const int rounds = std::stoi(argv[3]);
  const Problem problem = read_problem(argv[1], overrides);
  PetscInt subspace = 40;
  check(PetscOptionsGetInt(nullptr, nullptr, "-bench_subspace", &subspace, nullptr));
  char folder[PETSC_MAX_PATH_LEN] = "";
  check(PetscOptionsGetString(nullptr, nullptr, "-bench_write", folder, sizeof folder, nullptr));
  if (*folder) write_problem(problem, band, folder);
  PetscBool real_only = PETSC_FALSE;
  check(PetscOptionsGetBool(nullptr, nullptr, "-bench_real_only", &real_only, nullptr));
  Figures figures;
  std::map<std::string, Answer> last;
  const auto note = [&](const std::string& name, const Answer& answer)
  {
    figures[name].push_back(answer.seconds);
    last[name] = answer;
  };
  for (int round = 0; round < rounds; ++round)
  {
    note("real modes", real_modes_by_squeal(problem, band));
    note("interval", real_modes_by_slicing(problem, omega * omega, subspace));
    if (real_only) continue;
    note("slices", pairs_by(ModesMethod::full, problem, band));
    note("TOAR", pairs_by(ModesMethod::toar, problem, band));
  }
  PetscInt size = 0;
  check(MatGetSize(problem.K, &size, nullptr));
  std::printf("{\"size\": %d", static_cast<int>(size));
  for (const auto& [name, answer] : last)
    std::printf(", \"%s\": {\"seconds\": %.4g, \"found\": %d, \"residual\": %.2g}", name.c_str(), median(figures[name]),
                answer.found, answer.residual);
  std::printf("}\n");
}

} // namespace

int main(int argc, char** argv)
{
  return bench_main("bench_slepc", argc, argv, [&] { run(argc, argv); });
}
