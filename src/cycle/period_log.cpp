#include "squeal/cycle/period_log.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/checkpoint.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/equilibrium/file_order.hpp"

#include <array>
#include <cmath>
#include <optional>

namespace squeal
{

namespace
{

/// The log of this process's run, as its checkpoints. Its lists are on rank 0.
struct PeriodLog
{
  Checkpoint chunk{};       // read or written at present
  int chunks = 0, next = 0; // number of chunks before it; of periods in it that were taken or appended
  bool reads = true;
};

PeriodLog& period_log()
{
  static PeriodLog one;
  return one;
}

std::string chunk_name(int number)
{
  return format("periods.%06d", number);
}

std::string entry(int number, const char* part)
{
  return format("%06d ", number) + part;
}

/// By which a period is recognised: its length, and the norms of its start's parts.
std::array<double, 3> marks_of(double period, Vec start)
{
  std::array<double, 3> marks = {period, 0, 0};
  check(VecNorm(displacement(start), NORM_2, &marks[1]));
  check(VecNorm(velocity(start), NORM_2, &marks[2]));
  return marks;
}

/// Makes the next chunk the present one where that ends. On rank 0; returns whether there is a next period.
bool has_next(PeriodLog& log)
{
  while (true)
  {
    if (log.chunk.has(entry(log.next, "marks"))) return true;
    std::optional<Checkpoint> following = kept(chunk_name(log.chunks));
    if (!following) return false;
    log.chunk = std::move(*following);
    log.next = 0;
    ++log.chunks;
  }
}

bool matches(const std::vector<double>& logged, const std::array<double, 3>& marks)
{
  for (std::size_t i = 0; i < marks.size(); ++i)
    if (!(std::abs(logged.at(i) - marks[i]) <= 1e-9 * std::abs(marks[i]))) return false;
  return true;
}

/// From here on periods are appended. Of the present chunk, what was taken stays. On rank 0.
void stop_reading(PeriodLog& log)
{
  for (int later = log.chunks; kept(chunk_name(later)); ++later) remove_kept(chunk_name(later));
  Checkpoint taken;
  for (int i = 0; i < log.next; ++i)
    for (const char* part : {"marks", "end u", "end v", "rate u", "rate v", "reactions", "unconverged", "kept step"})
      taken.set(entry(i, part), log.chunk.list(entry(i, part)));
  log.chunk = std::move(taken);
  if (log.chunks > 0) --log.chunks; // it is written again with what follows
}

} // namespace

void begin_period_log()
{
  period_log() = {};
}

bool replay_period(PeriodMap& map, double period, Vec start, Vec end, Vec rate)
{
  PeriodLog& log = period_log();
  const MPI_Comm comm = comm_of(map.sliding.structure.load);
  if (!log.reads) return false;
  const std::array<double, 3> marks = marks_of(period, start);
  std::vector<double> carried; // 1 if the log goes on; reactions, unconverged steps
  if (rank_of(comm) == 0)
  {
    const bool goes_on = has_next(log) && matches(log.chunk.list(entry(log.next, "marks")), marks);
    if (goes_on) carried = log.chunk.list(entry(log.next, "reactions"));
    if (goes_on)
      for (const double part : log.chunk.list(entry(log.next, "kept step"))) carried.push_back(part);
    if (goes_on) carried.push_back(log.chunk.number(entry(log.next, "unconverged")));
    carried.push_back(goes_on);
    if (!goes_on) stop_reading(log);
  }
  broadcast(carried, comm);
  log.reads = carried.back() != 0;
  if (!log.reads) return false;
  const auto part = [&](const char* name)
  { return rank_of(comm) == 0 ? log.chunk.list(entry(log.next, name)) : std::vector<double>(); };
  const FileOrder order(map.sliding.structure);
  order.scatter(part("end u"), displacement(end));
  order.scatter(part("end v"), velocity(end));
  order.scatter(part("rate u"), displacement(rate));
  order.scatter(part("rate v"), velocity(rate));
  carried.pop_back();
  map.unconverged = static_cast<long>(carried.back());
  carried.pop_back();
  for (double* kept : {&map.kept.moved, &map.kept.curvature, &map.kept.h})
  {
    *kept = carried.back();
    carried.pop_back();
  }
  map.reactions = std::move(carried);
  ++log.next;
  return true;
}

void log_period(const PeriodMap& map, double period, Vec start, Vec end, Vec rate)
{
  if (!checkpoints_are_kept()) return;
  PeriodLog& log = period_log();
  const std::array<double, 3> marks = marks_of(period, start);
  const FileOrder order(map.sliding.structure);
  const std::array<std::pair<const char*, Vec>, 4> parts = {{{"end u", displacement(end)},
                                                             {"end v", velocity(end)},
                                                             {"rate u", displacement(rate)},
                                                             {"rate v", velocity(rate)}}};
  const bool writes = rank_of(comm_of(map.sliding.structure.load)) == 0;
  for (const auto& [name, x] : parts)
  {
    std::vector<double> entries = order.gather(x);
    if (writes) log.chunk.set(entry(log.next, name), std::move(entries));
  }
  if (writes)
  {
    log.chunk.set(entry(log.next, "marks"), std::vector<double>(marks.begin(), marks.end()));
    log.chunk.set(entry(log.next, "reactions"), map.reactions);
    log.chunk.set(entry(log.next, "kept step"), std::vector<double>{map.kept.h, map.kept.curvature, map.kept.moved});
    log.chunk.set(entry(log.next, "unconverged"), static_cast<double>(map.unconverged));
  }
  ++log.next;
  if (!checkpoint_is_due()) return;
  if (writes) keep_period_log();
  checkpoint_made();
}

void keep_period_log()
{
  PeriodLog& log = period_log();
  if (log.reads || log.next == 0 || !log.chunk.has(entry(0, "marks"))) return;
  keep(log.chunk, chunk_name(log.chunks));
  constexpr int full = 50; // periods in a chunk: one that grows is written again each time
  if (log.next < full) return;
  log.chunk = {};
  log.next = 0;
  ++log.chunks;
}

} // namespace squeal
