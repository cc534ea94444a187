#include "sweep_checkpoint.hpp"

#include "squeal/base/petsc.hpp"
#include "squeal/base/run_control.hpp"

namespace squeal
{

namespace
{

/// Reads the numbers of a list one after the other.
class List
{
public:
  List(const Checkpoint& checkpoint, const std::string& name) : values_(checkpoint.list(name)) {}

  bool ended() const { return next_ >= values_.size(); }

  double number()
  {
    if (ended()) throw Error("the checkpoint of the sweep is cut short: run again without --restart");
    return values_[next_++];
  }

  int integer() { return static_cast<int>(number()); }

  std::vector<double> numbers()
  {
    std::vector<double> list(static_cast<std::size_t>(number()));
    for (double& value : list) value = number();
    return list;
  }

  std::string text()
  {
    std::string text;
    for (const double letter : numbers()) text.push_back(static_cast<char>(letter));
    return text;
  }

private:
  const std::vector<double>& values_;
  std::size_t next_ = 0;
};

void append(const std::vector<double>& numbers, std::vector<double>& list)
{
  list.push_back(static_cast<double>(numbers.size()));
  list.insert(list.end(), numbers.begin(), numbers.end());
}

void append_modes(const std::vector<SweptMode>& modes, std::vector<double>& list)
{
  list.push_back(static_cast<double>(modes.size()));
  for (const SweptMode& mode : modes)
    list.insert(list.end(), {mode.lambda.real(), mode.lambda.imag(), mode.backward_error,
                             static_cast<double>(mode.track), mode.mac, static_cast<double>(mode.subspace)});
}

std::vector<SweptMode> modes_from(List& list)
{
  std::vector<SweptMode> modes(static_cast<std::size_t>(list.integer()));
  for (SweptMode& mode : modes)
  {
    const double real = list.number(), imaginary = list.number();
    mode.lambda = {real, imaginary};
    mode.backward_error = list.number();
    mode.track = list.integer();
    mode.mac = list.number();
    mode.subspace = list.integer();
  }
  return modes;
}

void append(const SweepPoint& point, std::vector<double>& list)
{
  append(point.values, list);
  for (const int value : {static_cast<int>(point.reversed), static_cast<int>(point.inserted),
                          static_cast<int>(point.outcome.kind), point.closed, point.unstable})
    list.push_back(value);
  list.push_back(point.outcome.residual);
  append({point.outcome.reason.begin(), point.outcome.reason.end()}, list);
  append_modes(point.modes, list);
  append_modes(point.beyond, list);
}

SweepPoint point_from(List& list)
{
  SweepPoint point;
  point.values = list.numbers();
  point.reversed = list.integer() != 0;
  point.inserted = list.integer() != 0;
  point.outcome.kind = static_cast<OutcomeKind>(list.integer());
  point.closed = list.integer();
  point.unstable = list.integer();
  point.outcome.residual = list.number();
  point.outcome.reason = list.text();
  point.modes = modes_from(list);
  point.beyond = modes_from(list);
  return point;
}

} // namespace

Checkpoint packed(const Sweep& sweep)
{
  std::vector<double> points, thresholds;
  for (const SweepPoint& point : sweep.points) append(point, points);
  for (const Threshold& threshold : sweep.thresholds)
  {
    append(threshold.values, thresholds);
    thresholds.insert(thresholds.end(),
                      {static_cast<double>(threshold.reversed), static_cast<double>(threshold.track), threshold.error,
                       threshold.frequency_hz, static_cast<double>(threshold.change)});
  }
  Checkpoint checkpoint;
  checkpoint.set("points", std::move(points));
  checkpoint.set("thresholds", std::move(thresholds));
  checkpoint.set("following",
                 std::vector<double>{static_cast<double>(sweep.tracks), static_cast<double>(sweep.lost),
                                     sweep.least_mac, sweep.outcome.residual, static_cast<double>(sweep.basis),
                                     static_cast<double>(sweep.passes), static_cast<double>(sweep.groups),
                                     sweep.least_mac_across, static_cast<double>(sweep.cut_short)});
  return checkpoint;
}

Sweep unpacked(const Checkpoint& checkpoint)
{
  Sweep sweep;
  sweep.outcome.kind = OutcomeKind::converged;
  List points(checkpoint, "points"), thresholds(checkpoint, "thresholds"), following(checkpoint, "following");
  while (!points.ended()) sweep.points.push_back(point_from(points));
  while (!thresholds.ended())
  {
    Threshold& threshold = sweep.thresholds.emplace_back();
    threshold.values = thresholds.numbers();
    threshold.reversed = thresholds.integer() != 0;
    threshold.track = thresholds.integer();
    threshold.error = thresholds.number();
    threshold.frequency_hz = thresholds.number();
    threshold.change = thresholds.integer();
  }
  sweep.tracks = following.integer();
  sweep.lost = following.integer();
  sweep.least_mac = following.number();
  sweep.outcome.residual = following.number();
  sweep.basis = following.integer();
  sweep.passes = following.integer();
  sweep.groups = following.integer();
  sweep.least_mac_across = following.number();
  sweep.cut_short = following.integer();
  return sweep;
}

Checkpoint packed(const SweptMotion& motion)
{
  std::vector<double> numbers;
  for (const int value : {static_cast<int>(motion.outcome.kind), static_cast<int>(motion.kind),
                          static_cast<int>(motion.stability), motion.steps_per_period})
    numbers.push_back(value);
  numbers.insert(numbers.end(),
                 {motion.frequency_hz, motion.energy.value, motion.energy.error, motion.multiplier,
                  motion.multiplier_error, motion.estimate, motion.residual, static_cast<double>(motion.periods)});
  append({motion.outcome.reason.begin(), motion.outcome.reason.end()}, numbers);
  append({motion.heard.begin(), motion.heard.end()}, numbers);
  append(motion.peak_to_peak, numbers);
  Checkpoint checkpoint;
  checkpoint.set("motion", std::move(numbers));
  return checkpoint;
}

SweptMotion motion_from(const Checkpoint& checkpoint)
{
  List list(checkpoint, "motion");
  SweptMotion motion;
  motion.outcome.kind = static_cast<OutcomeKind>(list.integer());
  motion.kind = static_cast<MotionKind>(list.integer());
  motion.stability = static_cast<Stability>(list.integer());
  motion.steps_per_period = list.integer();
  for (double* number : {&motion.frequency_hz, &motion.energy.value, &motion.energy.error, &motion.multiplier,
                         &motion.multiplier_error, &motion.estimate, &motion.residual})
    *number = list.number();
  motion.periods = static_cast<long>(list.number());
  motion.outcome.reason = list.text();
  motion.heard = list.text();
  motion.peak_to_peak = list.numbers();
  return motion;
}

void keep_sweep(const Sweep& sweep, const std::string& name, MPI_Comm comm)
{
  checkpoint_made();
  if (checkpoints_are_kept() && rank_of(comm) == 0) keep(packed(sweep), name);
}

Sweep kept_sweep(const std::string& name, MPI_Comm comm)
{
  if (const std::optional<Checkpoint> checkpoint = kept_everywhere(name, comm)) return unpacked(*checkpoint);
  Sweep sweep;
  sweep.outcome.kind = OutcomeKind::converged;
  return sweep;
}

} // namespace squeal
