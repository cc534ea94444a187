/// Times the theta-step of a matrix folder, for tools/bench: one line of JSON on standard output.
///     bench_step FOLDER STATE h mu steps trajectories [dump]
/// Trajectory k starts from STATE with its velocity scaled by 1 + k/1000. `dump`: the first trajectory's u and v after
/// every step, raw doubles. Seconds are the processor's, of this rank, waiting included. Contact options as in squeal
/// (-transient_…).
#include "bench_timing.hpp"
#include "bench_trajectories.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/options.hpp"
#include "squeal/transient/transient.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <fstream>

using namespace squeal;

namespace
{

/// b of the first step, by the displacement law; on rank 0.
std::vector<double> first_problem(const ThetaStep& step, const Structure& structure, const Interface& interface,
                                  const State& state, const StepWork& work)
{
  const auto rhs = copy_of(work.Mv), position = zeros_like(structure.load), v = zeros_like(structure.load);
  check(VecAXPBYPCZ(rhs, (step.theta - 1) / step.theta, -step.h, 1 / step.theta, work.Av, work.Ku));
  check(VecAXPY(rhs, step.h, structure.load));
  std::vector<double> b = step.factor.forward(std::array<Vec, 1>{rhs});
  step.factor.backward(std::vector<double>(b.size(), 0.), std::array<Vec, 1>{v});
  check(VecWAXPY(position, step.h * (1 - step.theta), state.v, state.u));
  const std::vector<double> displaced = relative(interface, position);
  broadcast(b, comm_of(interface.B)); // for ranks that share W
  const PairView<const double> moved(displaced, interface.directions);
  const PairView<double> velocity(b, interface.directions);
  const TangentView drive(interface.drive, interface.directions);
  for (std::size_t i = 0; i < velocity.pairs(); ++i)
  {
    velocity.normal(i) += (interface.gap[i] + moved.normal(i)) / step.h;
    for (std::size_t k = 0; k < drive.of(i).size(); ++k) velocity.tangential(i)[k] -= drive.of(i)[k];
  }
  return b;
}

/// Seconds of contact alone from r = 0, and the sweeps.
std::pair<double, int> cold_contact(const ThetaStep& step, const PairFriction& friction, const std::vector<double>& b,
                                    ContactSolver solver)
{
  if (step.W.size() == 0) return {0, 0}; // another rank's alone
  ContactSettings settings = step.contact;
  settings.solver = solver;
  settings.max_iterations = 100000;
  int sweeps = 0;
  const double taken = seconds(3,
                               [&]
                               {
                                 std::vector<double> r;
                                 ContactMemory memory;
                                 sweeps = solve_contact(step.W, friction, settings, {b, r, memory}).iterations;
                               });
  return {taken, sweeps};
}

/// Entries of the factor of A alone.
double plain_factor_entries(const Structure& structure, double h)
{
  return Factor(step_matrix(structure, h, 0.5), nullptr, FactorOptions{.kind = FactorKind::supernodal}).entries();
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
  const double begin = processor_time();
  const StepOptions options = read_program_options(comm).step;
  const ThetaStep step = make_theta_step(structure, interface, h, 0.5, options);
  const double prepared = processor_time() - begin;

  auto [states, works] = trajectories_from(start, count, step, structure, interface);
  const std::vector<double> b = first_problem(step, structure, interface, states[0], works[0]);
  std::ofstream dump;
  if (words.size() > 6 && speaks) dump.open(words[6], std::ios::binary);
  std::vector<double> taken;
  double iterations = 0, residual = 0, defect = 0;
  for (int i = 0; i < steps; ++i)
  {
    const double before = processor_time();
    const std::vector<StepReport> reports = advance(step, structure, interface, works, states);
    taken.push_back(processor_time() - before);
    for (const StepReport& report : reports)
    {
      iterations += report.contact_iterations;
      residual = std::max(residual, report.contact_residual);
      defect = std::max(defect, std::abs(report.energy_defect) / report.energy);
    }
    if (words.size() > 6)
      for (const Vec x : {states[0].u.get(), states[0].v.get()})
      {
        const std::vector<double> all = all_entries(x);
        dump.write(reinterpret_cast<const char*>(all.data()), static_cast<std::streamsize>(8 * all.size()));
      }
  }
  const auto x = zeros_like(structure.load);
  const double solve_time = seconds(5, [&] { solve(step.factor, structure.load, x); });
  const double product_time = seconds(5, [&] { check(MatMult(structure.K, structure.load, x)); });
  const double resident = peak_memory(comm) / 1024 / 1024;
  const auto [cold, cold_sweeps] = cold_contact(step, interface.friction, b, ContactSolver::gauss_seidel);
  const auto [fixed, fixed_sweeps] = cold_contact(step, interface.friction, b, ContactSolver::fixed_point);
  const double entries = plain_factor_entries(structure, h);
  const std::size_t dofs = all_entries(structure.load).size();
  if (!speaks) return;
  taken.erase(taken.begin());
  std::printf("{\"dofs\": %d, \"pairs\": %d, \"ranks\": %d, \"trajectories\": %d, \"step\": %.4g, "
              "\"step_each\": %.4g, \"prepare\": %.4g, \"solve\": %.4g, "
              "\"product\": %.4g, \"iterations\": %.4g, \"residual\": %.3g, \"energy_defect\": %.3g, "
              "\"near_field\": %.4g, \"resident_MB\": %.4g, "
              "\"contact_cold\": %.4g, \"cold_sweeps\": %d, \"fixed_point_cold\": %.4g, \"fixed_point_sweeps\": %d, "
              "\"factor_entries\": %.6g}\n",
              static_cast<int>(dofs), interface.pairs, ranks_of(comm), count, median(taken), median(taken) / count,
              prepared, solve_time, product_time, iterations / steps / count, residual, defect, step.W.near_share(),
              resident, cold, cold_sweeps, fixed, fixed_sweeps, entries);
}

} // namespace

int main(int argc, char** argv)
{
  std::vector<std::string> words;
  for (int i = 1; i < argc && argv[i][0] != '-'; ++i) words.emplace_back(argv[i]);
  return bench_main("bench_step", argc, argv, [&] { run(words); });
}
