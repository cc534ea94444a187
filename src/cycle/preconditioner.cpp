#include "squeal/cycle/preconditioner.hpp"

#include "reduced_flow.hpp"
#include "squeal/cycle/floquet.hpp"

#include <span>

namespace squeal
{

namespace
{

/// The correction and the function that applies P^-1 by it.
struct RecordedInverse
{
  MonodromyCorrection correction;
  Preconditioner apply; // borrows the correction; empty: none
};

/// From the period that the map recorded last. Integrated once more, it gives the flow.
void make(CycleProblem& problem, PeriodMap& map, std::shared_ptr<const ReducedModel>& kept, RecordedInverse& inverse)
{
  if (!map.recorded_start.get() || problem.modes.empty()) return;
  if (!(problem.modes.front().frequency_hz() > 0)) return; // a mode that only diverges is no scale of a basis
  const Owned<Vec> start = copy_of(map.recorded_start.get()), end = copy_of(start.get()), rate = zeros_like(start);
  const double period = map.steps * map.recorded_step;
  flow_of(map).integrate(period, start, end, rate);
  try
  {
    std::string missing;
    kept = recorded_model(problem, std::span(&map.records, 1), missing);
    if (!kept) return;
    ReducedMap own{*kept, map.steps, map.theta, comm_of(problem.sliding.structure.load)};
    const auto contacts = recorded_contacts(*kept, problem.sliding.interface.directions, map.records);
    const ReducedState flow = coordinates(*kept, problem.sliding.structure, displacement(rate), velocity(rate));
    inverse.correction = monodromy_correction(*kept, monodromy(own, period, contacts), flow);
    problem.reduced = kept.get();
    inverse.apply = preconditioner_of(inverse.correction, coordinates_in(*kept, problem.sliding.structure));
  }
  catch (const LibraryError&) // perhaps on this rank alone
  {
    throw;
  }
  catch (const Error&) // on every rank alike
  {
    kept.reset();
  }
}

} // namespace

RealModes real_modes_beyond(const CycleProblem& problem, double highest)
{
  constexpr double far = 0.9;
  const double end = highest_frequency(problem.modes);
  if (end >= far * highest) return {};
  return find_real_modes_between(problem.linearised, end, highest, problem.modes_options);
}

Preconditioner recorded_preconditioner(CycleProblem& problem, PeriodMap& map, std::shared_ptr<const ReducedModel>& kept)
{
  return [&problem, &map, &kept, inverse = std::shared_ptr<RecordedInverse>()](double period, Vec x, Vec y) mutable
  {
    if (!inverse)
    {
      inverse = std::make_shared<RecordedInverse>();
      make(problem, map, kept, *inverse);
    }
    apply(inverse->apply, period, x, y);
  };
}

} // namespace squeal
