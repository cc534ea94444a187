/// Events of contact inside steps (src/README.md, section 4.14).
#include "squeal/algebra/multivector.hpp"
#include "squeal/transient/theta_step.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace squeal
{

namespace
{

/// The states of pairs in the steps of an orbit, which goes on from its end to its start.
class PairsInSteps
{
public:
  PairsInSteps(const Interface& interface, std::span<const StepRecord> records)
      : interface_(interface), records_(records)
  {
    for (const StepRecord& record : records)
      statuses_.push_back(contact_status(interface, record.reactions, record.contact_velocity));
  }

  long steps() const { return static_cast<long>(records_.size()); }
  std::size_t place(long step) const { return static_cast<std::size_t>((step % steps() + steps()) % steps()); }
  ContactStatus status(std::size_t pair, long step) const { return statuses_[place(step)][pair]; }
  std::span<const double> sliding(std::size_t pair, long step) const
  {
    return PairView<const double>(records_[place(step)].contact_velocity, interface_.directions).tangential(pair);
  }

  /// Whether the pair has one status in both steps, and slides alike.
  bool is_same(std::size_t pair, long a, long b) const
  {
    if (status(pair, a) != status(pair, b)) return false;
    return status(pair, a) != ContactStatus::slip || dot(sliding(pair, a), sliding(pair, b)) > 0;
  }

  /// The first step, from this one on, of a status that lasts.
  long lasting(std::size_t pair, long step) const
  {
    constexpr long lasts = 3, most = 8; // steps
    for (const long begin = step; step < begin + most;)
    {
      long same = 1;
      while (same < lasts && is_same(pair, step, step + same)) ++same;
      if (same == lasts) break;
      step += same;
    }
    return step;
  }

private:
  const Interface& interface_;
  std::span<const StepRecord> records_;
  std::vector<std::vector<ContactStatus>> statuses_;
};

/// The event that begins with this step of the pair; `end` is 0 where there is none.
StepEvent event_at(const Interface& interface, const PairsInSteps& pairs, std::size_t pair, long step)
{
  constexpr long of_impact = 2; // steps that an impact takes
  StepEvent event{pair, step};
  const ContactStatus before = pairs.status(pair, step - 1), now = pairs.status(pair, step);
  if (now == ContactStatus::open || pairs.is_same(pair, step - 1, step) || slip_compliance_of(interface, pair) > 0)
    return event;
  event.weights.assign(1 + static_cast<std::size_t>(interface.directions), 0);
  const std::span<double> along = std::span(event.weights).subspan(1);
  const long lasting = pairs.lasting(pair, step);
  if (before == ContactStatus::open)
  {
    if (compliance_of(interface, pair) > 0) return event;
    event.is_impact = true;
    event.weights[0] = 1;
    event.end = std::max(lasting, step + of_impact);
  }
  else if (before == ContactStatus::slip)
  {
    if (pairs.status(pair, lasting) != ContactStatus::slip || pairs.is_same(pair, step - 1, lasting)) return event;
    std::ranges::copy(pairs.sliding(pair, step - 1), along.begin());
    event.end = std::max(lasting, step + 1);
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

/// The orbit's states and its flow.
class Path
{
public:
  Path(const ThetaStep& step, const Interface& interface, const RecordedOrbit& orbit, const PairsInSteps& pairs)
      : h_(step.h), interface_(interface), orbit_(orbit), pairs_(pairs)
  {
  }

  /// The flow at the end of `step` - 1 or the start of `step`, from one step on that side of it or, where there are
  /// two, to second order.
  TangentColumn flow(long step, bool ends_there, bool has_two) const
  {
    TangentColumn flow = difference(ends_there ? step - 1 : step);
    if (!has_two) return flow;
    const TangentColumn beyond = difference(ends_there ? step - 2 : step + 1);
    add(-1. / 3, beyond, flow);
    check(VecScale(flow.u, 1.5));
    check(VecScale(flow.v, 1.5));
    return flow;
  }

  /// c of the event before `step`.
  double passing_at(const StepEvent& event, long step) const
  {
    const TangentColumn state = column(pairs_.place(step));
    const double c = passing(interface_, event, std::span(&state, 1)).front();
    const TangentView drive(interface_.drive, interface_.directions);
    return c + (event.is_impact ? interface_.gap[event.pair]
                                : -dot(std::span(event.weights).subspan(1), drive.of(event.pair)));
  }

  /// Sets what `event` is without, by its own steps and the free ones on both sides. Whether it has a place.
  bool complete(StepEvent& event, long free_before, long free_after) const
  {
    const double c = passing_at(event, event.first), last = c - passing_at(event, event.first - 1),
                 before = free_before > 1 ? c - last - passing_at(event, event.first - 2) : last,
                 slope = (3 * last - before) / 2;
    if (!(slope < 0)) return false;
    event.ahead = std::clamp(-c / slope, -1., 2.);
    event.rate = (slope + event.ahead * (last - before)) / h_;
    event.before = flow(event.first, true, free_before > 1);
    event.after = flow(event.end, false, free_after > 1);
    return event.rate < 0;
  }

private:
  TangentColumn column(std::size_t place) const
  {
    TangentColumn column{copy_of(orbit_.pattern), copy_of(orbit_.pattern)};
    copy_column(orbit_.u, static_cast<Eigen::Index>(place), column.u);
    copy_column(orbit_.v, static_cast<Eigen::Index>(place), column.v);
    return column;
  }

  TangentColumn difference(long step) const
  {
    TangentColumn next = column(pairs_.place(step) + 1);
    add(-1, column(pairs_.place(step)), next);
    check(VecScale(next.u, 1 / h_));
    check(VecScale(next.v, 1 / h_));
    return next;
  }

  double h_;
  const Interface& interface_;
  const RecordedOrbit& orbit_;
  const PairsInSteps& pairs_;
};

} // namespace

std::vector<StepEvent> events_inside_steps(const ThetaStep& step, const Interface& interface,
                                           const RecordedOrbit& orbit)
{
  const PairsInSteps pairs(interface, orbit.records);
  std::vector<StepEvent> found, result;
  for (std::size_t pair = 0; pair < interface.gap.size(); ++pair)
    for (long k = 0; k < pairs.steps(); ++k)
    {
      StepEvent event = event_at(interface, pairs, pair, k);
      if (event.end == 0) continue;
      k = event.end - 1;
      found.push_back(std::move(event));
    }
  std::ranges::stable_sort(found, {}, &StepEvent::first);
  const Path path(step, interface, orbit, pairs);
  for (std::size_t i = 0; i < found.size(); ++i)
  {
    const StepEvent &previous = found[(i + found.size() - 1) % found.size()], &next = found[(i + 1) % found.size()];
    StepEvent& event = found[i];
    const long before = event.first - previous.end + (i == 0 ? pairs.steps() : 0),
               after = next.first - event.end + (i + 1 == found.size() ? pairs.steps() : 0);
    if (before > 0 && after > 0 && path.complete(event, before, after)) result.push_back(std::move(event));
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
