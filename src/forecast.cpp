/// Memory is what each stage holds at its peak. To the system's own count after the model is made it adds copies of
/// matrices, factors by their symbolic analysis, dense operators and vectors. Time is that of two pieces of work that
/// runs repeat. A factor takes it by its operations, a step by the memory that it reads (src/README.md,
/// section 8.9).
#include "squeal/forecast.hpp"

#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/base/available_memory.hpp"
#include "squeal/base/cost.hpp"
#include "squeal/base/free_memory.hpp"
#include "squeal/point.hpp"
#include "squeal/reduction/reduced_model.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

constexpr double usual_periods = 50;                               // of shooting from the estimate to a cycle
constexpr int usual_steps = 128;                                   // a period, where they are chosen
constexpr double seconds_of_calls = 2.5e-5;                        // a step of a model of one mass, which is all calls
constexpr double operations_a_second = 3e10, bytes_a_second = 8e9; // of a usual core while all work
constexpr double day = 86400;                                      // [s]
constexpr double dense_copies = 24; // of n x n numbers in a dense quadratic problem: a pencil of size 2 n, six times
// A slice takes about 150 pairs with their neighbours, and passes append two directions a pair. So V has 500 columns;
// with a copy while it grows, and residuals, images and right sides of a pass:
constexpr double vectors_of_modes = 2 * 500 + 300;
constexpr double vectors_of_modes_kept = 200; // of 100 pairs
constexpr double vectors_of_shooting = 100;   // pairs of differences, work of a step, columns of the multipliers
constexpr double shapes_of_response = 300;    // beside which there is their copy while the basis grows

double steps_of_transient(const TransientSettings& transient)
{
  if (!transient.enabled) return 0;
  return transient.steps > 0 ? static_cast<double>(transient.steps) : transient.periods * transient.steps_per_period;
}

double steps_of(const Scene& scene, const ProgramOptions& options)
{
  double steps = steps_of_transient(scene.transient);
  if (!scene.cycle.enabled) return steps;
  const double a_period = scene.cycle.steps_per_period > 0 ? scene.cycle.steps_per_period : usual_steps;
  const double cycle = a_period * std::min(usual_periods, static_cast<double>(options.cycle.shooting.max_periods));
  const double starts = scene.cycle.starts, points = scene.branch ? scene.branch->points : 0;
  return steps + cycle * (1 + starts + points) + a_period * scene.cycle.free_periods;
}

double sum_of_ranks(double value, MPI_Comm comm)
{
  MPI_Allreduce(MPI_IN_PLACE, &value, 1, MPI_DOUBLE, MPI_SUM, comm);
  return value;
}

std::string duration(double seconds)
{
  if (seconds < 120) return format("%.2g s", seconds);
  if (seconds < 7200) return format("%.2g minutes", seconds / 60);
  if (seconds < 2 * day) return format("%.2g hours", seconds / 3600);
  return seconds < 1000 * day ? format("%.3g days", seconds / day) : format("%.3g years", seconds / (365.25 * day));
}

constexpr double number = sizeof(double);                               // [bytes]
constexpr double matrix_entry = sizeof(PetscScalar) + sizeof(PetscInt); // in PETSc's rows
constexpr double triplet = sizeof(PetscScalar) + 2 * sizeof(int);       // of what a factor is made from

/// The sizes that set the stages' work, of all ranks together.
struct Sizes
{
  double dofs = 0, entries = 0;  // of K
  double pairs = 0, contact = 0; // rows of B
  double ranks = 1;
  FactorForecast factor{};

  double condensed_operator() const { return number * contact * contact; }
};

Sizes sizes_of(const Model& model, const FactorOptions& options)
{
  Sizes sizes;
  const Mat K = model.structure.K;
  MatInfo info;
  check(MatGetInfo(K, MAT_GLOBAL_SUM, &info)); // info.memory is 0 in most builds
  sizes.dofs = row_count(K);
  sizes.entries = info.nz_used;
  sizes.pairs = model.interface.pairs;
  sizes.ranks = ranks_of(comm_of(K));
  sizes.contact = static_cast<double>(model.interface.size());
  sizes.factor = forecast_factor(K, model.interface.pairs > 0 ? model.interface.B.get() : nullptr, options);
  return sizes;
}

/// The factor, and half of the matrix as triplets and by columns.
double memory_of_factor(const Sizes& sizes)
{
  return sizes.factor.bytes + 2 * triplet * sizes.entries / 2;
}

/// K with springs at the pairs, its factor, and five matrices of pairs. Those are two parts of D, their sum with
/// friction, its factor and, with springs, the part taken off again.
double memory_of_equilibrium(const Sizes& sizes)
{
  return matrix_entry * sizes.entries + memory_of_factor(sizes) + sizes.condensed_operator() +
         4 * number * sizes.pairs * sizes.pairs;
}

/// Six matrices: M and K of the frictionless problem, M, C and K of the sliding one, and C with friction. The pencil of
/// the search, L U of twice the size of L D L', which is made when that of the count is gone. The vectors: the largest
/// subspace of a slice.
double memory_of_modes(const Sizes& sizes, const ModesOptions& options, MPI_Comm comm)
{
  if (sizes.dofs <= static_cast<double>(options.dense_limit)) return dense_copies * number * sizes.dofs * sizes.dofs;
  return 6 * matrix_entry * sizes.entries +
         forecast_pencil(sizes.factor, sizes.entries, Keep::lu, options.pencil, comm) +
         number * vectors_of_modes * sizes.dofs;
}

/// Eight matrices: M, C and K of the sliding problem, that of loss factors, and their transposes. The pencil, the
/// basis with its copy while it grows, and the responses with those of the basis before.
double memory_of_response(const Sizes& sizes, const Scene& scene, const ProgramOptions& options, MPI_Comm comm)
{
  const double driven = static_cast<double>(scene.response->excitation.size()),
               read = static_cast<double>(scene.probes.size());
  const double pairs = (driven > 0 ? driven : read) * read;
  return 8 * matrix_entry * sizes.entries +
         forecast_pencil(sizes.factor, sizes.entries, Keep::factor, options.modes.pencil, comm) +
         number * 2 * std::min(sizes.dofs, shapes_of_response) * sizes.dofs +
         3 * 2 * number * sizes.ranks * pairs * scene.response->count;
}

bool shares_operator(const Sizes& sizes)
{
  return sizes.factor.kind == FactorKind::supernodal && sizes.ranks > 1 &&
         sizes.contact * sizes.contact >= entries_per_exchange;
}

/// M and K together, the factor, and the near field in single precision, which may be all of W. W is whole on rank 0,
/// or ranks share its lower triangle.
double memory_of_step(const Sizes& sizes)
{
  const double whole = sizes.condensed_operator(), near_field = whole / 2,
               stored = shares_operator(sizes) ? whole / 2 : whole;
  return (2 * number + sizeof(PetscInt)) * sizes.entries / 2 + matrix_entry * sizes.entries + memory_of_factor(sizes) +
         near_field + stored + number * vectors_of_modes_kept * sizes.dofs;
}

/// A reduced model has at most a shape for each pair, and those of the modes. Two may be held: that of the start, which
/// takes no more than its part of what is `free`, and that of the multipliers. Both have fewer shapes unless the
/// reduced cycle is the answer. The latter is done without where it does not fit. The tangent needs a whole W.
double memory_of_cycle(const Sizes& sizes, CycleModel fidelity, double free)
{
  const double whole = shares_operator(sizes) ? sizes.condensed_operator() : 0;
  const double least = memory_of_step(sizes) + whole + number * vectors_of_shooting * sizes.dofs;
  const auto shapes = [&](double pairs) { return memory_of_reduction(sizes.dofs, pairs + vectors_of_modes_kept); };
  const double multipliers = shapes(std::min<double>(sizes.pairs, attachments_on_recorded_contact)),
               all = fidelity == CycleModel::reduced ? shapes(sizes.pairs) : multipliers;
  const double start = fidelity == CycleModel::full ? 0 : std::min(all, memory_for_shapes(free));
  return least + start + multipliers <= free ? least + start + multipliers : least + start;
}

} // namespace

double Forecast::bytes() const
{
  double most = held;
  for (const StageForecast& stage : stages) most = std::max(most, stage.bytes);
  return most;
}

Forecast forecast_of(const Model& model, const Scene& scene, const ProgramOptions& options)
{
  Forecast forecast;
  const Sizes sizes = sizes_of(model, options.factor);
  const MPI_Comm comm = comm_of(model.structure.K);
  forecast.several_ranks = sizes.ranks > 1;
  forecast.factor = sizes.factor.kind;
  forecast.factor_share = sizes.factor.bytes / sizes.ranks;
  forecast.factor_limit = 1e9 * options.factor.share_limit();
  forecast.held = sum_of_ranks(memory_entry("/proc/self/status", "VmRSS:").value_or(0), comm);
  const double free = free_memory(comm);
  // two products a step, each of which reads half of W
  forecast.step_seconds =
      seconds_of_calls + (sizes.factor.bytes + sizes.condensed_operator()) / sizes.ranks / bytes_a_second;
  forecast.factor_seconds = sizes.factor.operations / operations_a_second;
  const auto add = [&](Stage stage, double bytes) { forecast.stages.push_back({stage, forecast.held + bytes}); };
  add(Stage::equilibrium, memory_of_equilibrium(sizes));
  if (seeks_modes(scene)) add(Stage::modes, memory_of_modes(sizes, options.modes, comm));
  if (scene.response) add(Stage::response, memory_of_response(sizes, scene, options, comm));
  const double entries = 9 + static_cast<double>(scene.probes.size()); // of History, a step
  if (scene.transient.enabled)
    add(Stage::transient, memory_of_step(sizes) + number * entries * steps_of_transient(scene.transient));
  if (scene.cycle.enabled) add(Stage::cycle, memory_of_cycle(sizes, scene.fidelity, free));
  constexpr double of_point = 16 * number; // of what points and samples are laid out in; their modes come on top
  if (scene.sweep)
    add(Stage::sweep, 2 * of_point *
                          static_cast<double>(std::max(scene.sweep->values.size() + scene.sweep->design.size(),
                                                       static_cast<std::size_t>(scene.sweep->points))));
  if (scene.robustness) add(Stage::robustness, of_point * scene.robustness->samples);
  forecast.steps = steps_of(scene, options);
  return forecast;
}

std::string factor_text(const Forecast& forecast)
{
  std::string text =
      format("  factor: %s, %.3g MB a rank foreseen", word(forecast.factor), 1e-6 * forecast.factor_share);
  if (forecast.several_ranks)
    text += format("; a supernodal one may take %.3g MB (-factor_limit)", 1e-6 * forecast.factor_limit);
  return text + "\n";
}

std::string text_of(const Forecast& forecast)
{
  std::string text =
      factor_text(forecast) + format("  memory forecast, all ranks together: model %.3g MB", 1e-6 * forecast.held);
  for (const StageForecast& stage : forecast.stages)
    text += format(", %s %.3g MB", word(stage.stage), 1e-6 * stage.bytes);
  text += format("; at most %.3g MB, with up to 120 modes\n", 1e-6 * forecast.bytes());
  text += format("  time forecast, by %.2g Gflop/s and %.2g GB/s a rank: a factor %s", 1e-9 * operations_a_second,
                 1e-9 * bytes_a_second, duration(forecast.factor_seconds).c_str());
  if (forecast.steps > 0)
    text += format("; about %.3g time steps of %.2g s, %s", forecast.steps, forecast.step_seconds,
                   duration(forecast.seconds_of_steps()).c_str());
  text += "\n";
  return text;
}

std::string problem_of(const Forecast& forecast, MPI_Comm comm)
{
  const double available = free_memory(comm), more = forecast.bytes() - forecast.held;
  std::string problem;
  if (more > available)
    problem = format("the run would take about %.3g GB of memory beyond what the model has, and %.3g GB are free",
                     1e-9 * more, 1e-9 * available);
  else if (forecast.seconds_of_steps() > day)
    problem = format("the run would make about %.3g time steps of %.2g s, which take %s", forecast.steps,
                     forecast.step_seconds, duration(forecast.seconds_of_steps()).c_str());
  if (!problem.empty()) problem += ": take a smaller model, fewer steps or a larger machine, or give --force to run it";
  return problem;
}

} // namespace squeal
