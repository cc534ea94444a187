/// Events of contact inside steps (src/README.md, section 4.14).
#include "squeal/transient/theta_step.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// The steps of an orbit, which goes on from its end to its start.
struct Path
{
  double h;
  const Interface& interface;
  std::span<const StepRecord> records;
  std::span<const TangentColumn> states;
  std::vector<std::vector<ContactStatus>> statuses{};

  long steps() const { return static_cast<long>(records.size()); }
  std::size_t place(long step) const { return static_cast<std::size_t>((step + steps()) % steps()); }
  ContactStatus status(std::size_t pair, long step) const { return statuses[place(step)][pair]; }
  std::span<const double> sliding(std::size_t pair, long step) const
  {
    return PairView<const double>(records[place(step)].contact_velocity, interface.directions).tangential(pair);
  }
};

/// Whether the pair has one status in both steps, and slides alike.
bool is_same(const Path& path, std::size_t pair, long a, long b)
{
  if (path.status(pair, a) != path.status(pair, b)) return false;
  return path.status(pair, a) != ContactStatus::slip || dot(path.sliding(pair, a), path.sliding(pair, b)) > 0;
}

/// The first step, from this one on, of a status that lasts.
long lasting(const Path& path, std::size_t pair, long step)
{
  constexpr long most = 8; // steps
  const long end = step + most;
  while (step < end && !(is_same(path, pair, step, step + 1) && is_same(path, pair, step, step + 2))) ++step;
  return step;
}

/// The event that begins with this step of the pair; `end` is 0 where there is none.
StepEvent event_at(const Path& path, std::size_t pair, long step)
{
  const Interface& interface = path.interface;
  constexpr long of_impact = 2; // steps that an impact takes
  StepEvent event{pair, step};
  const ContactStatus before = path.status(pair, step - 1), now = path.status(pair, step);
  if (now == ContactStatus::open || is_same(path, pair, step - 1, step) || slip_compliance_of(interface, pair) > 0)
    return event;
  event.weights.assign(1 + static_cast<std::size_t>(interface.directions), 0);
  const std::span<double> along = std::span(event.weights).subspan(1);
  const long last = lasting(path, pair, step);
  if (before == ContactStatus::open)
  {
    if (compliance_of(interface, pair) > 0) return event;
    event.is_impact = true;
    event.weights[0] = 1;
    event.end = std::max(last, step + of_impact);
  }
  else if (before == ContactStatus::slip)
  {
    if (path.status(pair, last) != ContactStatus::slip || is_same(path, pair, step - 1, last)) return event;
    std::ranges::copy(path.sliding(pair, step - 1), along.begin());
    event.end = std::max(last, step + 1);
  }
  const double size = std::sqrt(dot(along, along));
  for (double& weight : along) weight /= std::max(size, 1e-300);
  return event;
}

/// c of each column.
std::vector<double> passing(const Interface& interface, const StepEvent& event, std::span<const TangentColumn> columns)
{
  std::vector<Vec> vectors;
  for (const TangentColumn& column : columns) vectors.push_back(event.is_impact ? column.u : column.v);
  std::vector<double> result;
  for (const std::vector<double>& row : relative(interface, vectors))
  {
    const PairView<const double> view(row, interface.directions);
    result.push_back(event.weights[0] * view.normal(event.pair) +
                     dot(std::span(event.weights).subspan(1), view.tangential(event.pair)));
  }
  return result;
}

/// y += a x
void add(double a, const TangentColumn& x, TangentColumn& y)
{
  check(VecAXPY(y.u, a, x.u));
  check(VecAXPY(y.v, a, x.v));
}

/// The flow at the start of a step, by the step after it, or before it, and where there are two by both.
TangentColumn flow(const Path& path, long step, bool before, bool has_two)
{
  TangentColumn flow{zeros_like(path.states[0].u), zeros_like(path.states[0].v)};
  const auto add_step = [&](double part, long of)
  {
    add(part / path.h, path.states[path.place(of) + 1], flow);
    add(-part / path.h, path.states[path.place(of)], flow);
  };
  add_step(has_two ? 1.5 : 1, before ? step - 1 : step);
  if (has_two) add_step(-0.5, before ? step - 2 : step + 1);
  return flow;
}

/// c of the event before `step`.
double passing_at(const Path& path, const StepEvent& event, long step)
{
  const TangentView drive(path.interface.drive, path.interface.directions);
  const double still = event.is_impact ? path.interface.gap[event.pair]
                                       : -dot(std::span(event.weights).subspan(1), drive.of(event.pair));
  return still + passing(path.interface, event, path.states.subspan(path.place(step), 1)).front();
}

/// Sets what `event` is without, by its own steps and the free ones on both sides. Whether it has a place.
bool complete(const Path& path, long free_before, long free_after, StepEvent& event)
{
  const double c = passing_at(path, event, event.first), last = c - passing_at(path, event, event.first - 1),
               before = free_before > 1 ? c - last - passing_at(path, event, event.first - 2) : last,
               slope = (3 * last - before) / 2;
  if (!(slope < 0)) return false;
  event.ahead = std::clamp(-c / slope, -1., 2.);
  event.rate = (slope + event.ahead * (last - before)) / path.h;
  event.before = flow(path, event.first, true, free_before > 1);
  event.after = flow(path, event.end, false, free_after > 1);
  return event.rate < 0;
}

} // namespace

std::vector<StepEvent> events_inside_steps(const ThetaStep& step, const Interface& interface,
                                           std::span<const StepRecord> records, std::span<const TangentColumn> states)
{
  Path path{step.h, interface, records, states};
  for (const StepRecord& record : records)
    path.statuses.push_back(contact_status(interface, record.reactions, record.contact_velocity));
  std::vector<StepEvent> found, result;
  for (std::size_t pair = 0; pair < interface.gap.size(); ++pair)
    for (long k = 0; k < path.steps(); ++k)
      if (StepEvent event = event_at(path, pair, k); event.end > 0)
      {
        k = event.end - 1;
        found.push_back(std::move(event));
      }
  std::ranges::stable_sort(found, {}, &StepEvent::first);
  for (std::size_t i = 0; i < found.size(); ++i)
  {
    const StepEvent &previous = found[(i + found.size() - 1) % found.size()], &next = found[(i + 1) % found.size()];
    const long before = found[i].first - previous.end + (i == 0 ? path.steps() : 0),
               after = next.first - found[i].end + (i + 1 == found.size() ? path.steps() : 0);
    if (before > 0 && after > 0 && complete(path, before, after, found[i])) result.push_back(std::move(found[i]));
  }
  return result;
}

void advance_tangents(const ThetaStep& step, const Structure& structure, const Interface& interface,
                      std::span<const StepRecord> records, std::span<const StepEvent> events,
                      std::span<TangentColumn> columns)
{
  long at = 0;
  const auto go_on = [&](long to, std::span<TangentColumn> moved)
  {
    if (to > at)
      advance_tangents(step, structure, interface,
                       records.subspan(static_cast<std::size_t>(at), static_cast<std::size_t>(to - at)), moved);
  };
  for (const StepEvent& event : events)
  {
    if (event.first < 2 || event.end > static_cast<long>(records.size())) continue;
    go_on(event.first - 1, columns);
    at = event.first - 1;
    const std::vector<double> before = passing(interface, event, columns);
    go_on(event.first, columns);
    at = event.first;
    const std::vector<double> now = passing(interface, event, columns);
    TangentColumn carried{copy_of(event.before.u.get()), copy_of(event.before.v.get())};
    go_on(event.end, std::span(&carried, 1));
    go_on(event.end, columns);
    at = event.end;
    for (std::size_t k = 0; k < columns.size(); ++k)
    {
      const double earlier = (now[k] + event.ahead * (now[k] - before[k])) / event.rate; // [s]
      add(earlier, event.after, columns[k]);
      add(-earlier, carried, columns[k]);
    }
  }
  go_on(static_cast<long>(records.size()), columns);
}

} // namespace squeal
