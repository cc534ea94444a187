/// Times the theta-step of a matrix folder, for tools/bench: one line of JSON on standard output.
///     bench_step FOLDER STATE h mu steps trajectories [dump]
/// Trajectory k starts from STATE with its velocity scaled by 1 + k/1000. `dump`: the first trajectory's u and v after
/// every step, raw doubles. Contact options as in squeal (-transient_…).
#include "squeal/analysis/transient.hpp"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <sys/resource.h>

using namespace squeal;

namespace
{

double median(std::vector<double> values)
{
  if (values.empty()) return 0;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

/// Processor time, which a busy machine does not stretch; of this rank, waiting included.
double now()
{
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

template <class Work> double seconds(int times, Work work)
{
  std::vector<double> all;
  for (int i = 0; i < times; ++i)
  {
    const double start = now();
    work();
    all.push_back(now() - start);
  }
  return median(all);
}

double resident_megabytes()
{
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  double mine = static_cast<double>(usage.ru_maxrss) / 1024, all = 0;
  MPI_Reduce(&mine, &all, 1, MPI_DOUBLE, MPI_SUM, 0, PETSC_COMM_WORLD);
  return all;
}

void run(const std::vector<std::string>& words)
{
  const std::filesystem::path folder = words.at(0);
  const double h = std::stod(words.at(2)), mu = std::stod(words.at(3));
  const int steps = std::stoi(words.at(4)), count = std::stoi(words.at(5));
  const MPI_Comm comm = PETSC_COMM_WORLD;
  const bool speaks = rank_of(comm) == 0;
  const Structure structure = read_structure(folder, comm);
  const Interface interface = read_interface(folder, structure, {mu, true}, comm);
  const State start = read_state(words.at(1), structure);
  const double begin = now();
  const ThetaStep step = make_theta_step(structure, interface, h, .5);
  const double prepared = now() - begin;

  std::vector<State> states;
  std::vector<StepWork> works;
  for (int k = 0; k < count; ++k)
  {
    states.push_back(copy_of(start));
    check(VecScale(states.back().v, 1 + k / 1000.));
    works.push_back(begin_steps(step, structure, interface, states.back()));
  }
  std::ofstream dump;
  if (words.size() > 6 && speaks) dump.open(words[6], std::ios::binary);
  std::vector<double> taken;
  double iterations = 0, residual = 0, defect = 0;
  for (int i = 0; i < steps; ++i)
  {
    const double before = now();
    const std::vector<StepReport> reports = advance(step, structure, interface, works, states);
    taken.push_back(now() - before);
    for (const StepReport& report : reports)
    {
      iterations += report.contact_iterations;
      residual = std::max(residual, report.contact_residual);
      defect = std::max(defect, std::abs(report.energy_defect) / report.energy);
    }
    if (words.size() > 6)
      for (const Vec x : {states[0].u.get(), states[0].v.get()})
      {
        const std::vector<double> all = whole(x);
        dump.write(reinterpret_cast<const char*>(all.data()), static_cast<std::streamsize>(8 * all.size()));
      }
  }
  const auto x = zeros_like(structure.load);
  const double solve_time = seconds(5, [&] { solve(step.factor, structure.load, x); });
  const double product_time = seconds(5, [&] { check(MatMult(structure.K, structure.load, x)); });
  const double resident = resident_megabytes();
  const std::size_t dofs = whole(structure.load).size();
  if (!speaks) return;
  taken.erase(taken.begin());
  std::printf("{\"dofs\": %d, \"pairs\": %d, \"ranks\": %d, \"trajectories\": %d, \"step\": %.4g, "
              "\"step_each\": %.4g, \"prepare\": %.4g, \"solve\": %.4g, "
              "\"product\": %.4g, \"iterations\": %.4g, \"residual\": %.3g, \"energy_defect\": %.3g, "
              "\"near_field\": %.4g, \"resident_MB\": %.4g}\n",
              static_cast<int>(dofs), interface.pairs, ranks_of(comm), count, median(taken), median(taken) / count,
              prepared, solve_time, product_time, iterations / steps / count, residual, defect,
              static_cast<double>(step.W.near.values.size()) /
                  static_cast<double>(std::max<std::size_t>(1, step.W.W.size())),
              resident);
}

} // namespace

int main(int argc, char** argv)
{
  std::vector<std::string> words;
  for (int i = 1; i < argc && argv[i][0] != '-'; ++i) words.emplace_back(argv[i]);
  Session session(argc, argv, nullptr);
  try
  {
    run(words);
  }
  catch (const std::exception& error)
  {
    std::fprintf(stderr, "bench_step: %s\n", error.what());
    MPI_Abort(PETSC_COMM_WORLD, 1);
  }
}
