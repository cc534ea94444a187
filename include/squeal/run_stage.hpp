#pragma once
/// How a stage is run: it leaves its result, or why it has none.
#include "squeal/base/outcome.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/report/stage.hpp"

#include <functional>

namespace squeal
{

/// Runs the work of a stage, which returns whether the end of the run cut it short. Returns why the stage has no
/// result; empty if it has one.
using StageRunner = std::function<std::string(Stage which, const std::function<bool()>& work)>;

/// The result of a stage that did not run, with the reason.
template <class Result> Result not_run(OutcomeKind kind, const std::string& reason)
{
  Result result;
  result.outcome = {kind, reason, 0, 0};
  return result;
}

/// The result of the work, or why there is none. A stage that is off is not begun; `off`: why, empty where it is not.
template <class Work> auto run_stage(const StageRunner& run, Stage which, const std::string& off, const Work& work)
{
  decltype(work()) result;
  if (!off.empty()) return not_run<decltype(work())>(OutcomeKind::off, off);
  const auto all = [&] { return result = work(), result.outcome.kind == OutcomeKind::interrupted; };
  const std::string left_out = run(which, all);
  if (!left_out.empty()) result = not_run<decltype(work())>(OutcomeKind::skipped, left_out);
  return result;
}

} // namespace squeal
