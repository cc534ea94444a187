/// Forecasts from the analysis of the factor. The constants are fitted to measured runs of the TGV brake at two sizes
/// (tools/README.md, "Cost against size"), where they are right to 30 %.
#include "squeal/forecast.hpp"

#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/base/available_memory.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sys/mman.h>
#include <sys/resource.h>

namespace squeal
{

namespace
{

constexpr double modes_per_factor = 3;    // bytes of an unsymmetric factor with its room over those of the factor
constexpr double vectors_of_modes = 2000; // in the spaces of the slices; with both, 0.13 and 0.93 GB for 0.13 and 1.28
constexpr double seconds_per_byte = 1.4e-10;   // of a step, which reads factor and W: 1.45e-10 and 1.4e-10
constexpr double seconds_of_no_model = 2.5e-5; // a step of inputs/oscillator, which is all overhead
constexpr double periods_to_a_cycle = 50;      // of shooting from the estimate: 41 to 47
constexpr int usual_steps = 128;               // a period, where they are chosen
constexpr double day = 86400;                  // [s]
constexpr double start_of_libraries = 400e6;   // [byte] OpenBLAS's buffer of 128 MB, those of MPI and of PETSc

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
  const double cycle = a_period * std::min(periods_to_a_cycle, static_cast<double>(options.cycle.shooting.max_periods));
  const double starts = scene.cycle.starts, points = scene.branch ? scene.branch->points : 0;
  return steps + cycle * (1 + starts + points) + a_period * scene.cycle.free_periods;
}

bool seeks_modes(const Scene& scene)
{
  return scene.modes.enabled || scene.cycle.enabled || scene.transient.enabled;
}

/// What the node and the limits of its control group leave [byte].
double free_memory_of_node()
{
  double cgroup = HUGE_VAL, used = 0;
  std::ifstream limit("/sys/fs/cgroup/memory.max"), usage("/sys/fs/cgroup/memory.current");
  if (!(limit >> cgroup)) cgroup = HUGE_VAL; // also the word "max"
  usage >> used;
  return std::min(available_memory(), cgroup - used);
}

/// Of all nodes together.
double free_memory(MPI_Comm comm)
{
  MPI_Comm node = MPI_COMM_NULL;
  MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &node);
  double bytes = rank_of(node) == 0 ? free_memory_of_node() : 0;
  MPI_Comm_free(&node);
  MPI_Allreduce(MPI_IN_PLACE, &bytes, 1, MPI_DOUBLE, MPI_SUM, comm);
  return bytes;
}

/// Whether this process may take so many more bytes of addresses; the limit is that of ulimit -v.
bool can_take(double bytes)
{
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return true;
  if (bytes > static_cast<double>(limit.rlim_cur)) return false;
  const auto size = static_cast<std::size_t>(bytes);
  void* place = mmap(nullptr, size, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (place == MAP_FAILED) return false;
  munmap(place, size);
  return true;
}

std::string limit_text(double bytes)
{
  rlimit limit{};
  getrlimit(RLIMIT_AS, &limit);
  return format("it may take %.3g MB of addresses (ulimit -v %llu), and %.3g MB beyond what it has are needed",
                1e-6 * static_cast<double>(limit.rlim_cur), static_cast<unsigned long long>(limit.rlim_cur / 1024),
                1e-6 * bytes);
}

std::string duration(double seconds)
{
  if (seconds < 120) return format("%.2g s", seconds);
  if (seconds < 7200) return format("%.2g minutes", seconds / 60);
  if (seconds < 2 * day) return format("%.2g hours", seconds / 3600);
  return seconds < 1000 * day ? format("%.3g days", seconds / day) : format("%.3g years", seconds / (365.25 * day));
}

} // namespace

Forecast forecast_of(const Model& model, const Scene& scene, const ProgramOptions& options)
{
  Forecast forecast;
  const Structure& structure = model.structure;
  for (Mat matrix : {structure.M.get(), structure.C.get(), structure.K.get()})
  {
    MatInfo info;
    check(MatGetInfo(matrix, MAT_GLOBAL_SUM, &info));
    forecast.matrices += info.nz_used * (sizeof(PetscScalar) + sizeof(PetscInt)); // info.memory is 0 in most builds
  }
  forecast.factor =
      factor_memory(structure.K, model.interface.pairs > 0 ? model.interface.B.get() : nullptr, options.factor);
  const double contact_size = static_cast<double>(model.interface.size());
  forecast.condensed_operator = 8 * contact_size * contact_size;
  if (seeks_modes(scene))
  {
    PetscInt dofs = 0;
    check(MatGetSize(structure.K, &dofs, nullptr));
    forecast.modes = modes_per_factor * forecast.factor + 8 * vectors_of_modes * static_cast<double>(dofs);
  }
  const double entries = 9 + static_cast<double>(scene.probes.size()); // of History, a step
  forecast.history = 8 * entries * steps_of_transient(scene.transient);
  forecast.steps = steps_of(scene, options);
  forecast.step_seconds = seconds_of_no_model + seconds_per_byte * (forecast.factor + forecast.condensed_operator);
  return forecast;
}

std::string text_of(const Forecast& forecast)
{
  std::string text = format("  memory forecast, all ranks together: matrices %.3g MB, one factorisation %.3g MB, "
                            "condensed contact operator %.3g MB, modes %.3g MB, history %.3g MB\n",
                            1e-6 * forecast.matrices, 1e-6 * forecast.factor, 1e-6 * forecast.condensed_operator,
                            1e-6 * forecast.modes, 1e-6 * forecast.history);
  if (forecast.steps > 0)
    text += format("  time forecast: about %.3g time steps of %.2g s, %s\n", forecast.steps, forecast.step_seconds,
                   duration(forecast.seconds()).c_str());
  return text;
}

std::string problem_of(const Forecast& forecast, MPI_Comm comm)
{
  const double available = free_memory(comm);
  std::string problem;
  if (forecast.bytes() > available)
    problem = format("the run would take about %.3g GB of memory, and %.3g GB are free", 1e-9 * forecast.bytes(),
                     1e-9 * available);
  else if (const double share = forecast.bytes() - forecast.matrices * (1 - 1. / ranks_of(comm));
           rank_of(comm) == 0 && !can_take(share)) // rank 0 holds all but its part of the matrices
    problem = "memory: " + limit_text(share);
  else if (forecast.seconds() > day)
    problem = format("the run would make about %.3g time steps of %.2g s, which take %s", forecast.steps,
                     forecast.step_seconds, duration(forecast.seconds()).c_str());
  if (!problem.empty()) problem += ": take a smaller model, fewer steps or a larger machine, or give --force to run it";
  return problem;
}

std::string problem_of_address_space()
{
  if (can_take(start_of_libraries)) return {};
  return "memory: " + limit_text(start_of_libraries) + " to start: raise the limit";
}

} // namespace squeal
