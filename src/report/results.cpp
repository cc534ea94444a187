/// The tree of all results, report.json, and the page of results.
#include "results.hpp"

#include "files.hpp"
#include "squeal/base/markdown.hpp"

#include <array>
#include <utility>

namespace squeal
{

namespace
{

void add_outcome(Entry out, const Outcome& outcome)
{
  out.add("outcome", "how the stage ended", outcome.kind);
  if (out.has(!outcome.reason.empty())) out.add("reason", "text", "why, where the word is not enough", outcome.reason);
}

/// The part of a contact's slave surface that faces the other one.
void add_coverage(Entry out, const Contact& contact, const Coverage& coverage)
{
  out.add("rotor", "text", "the contact's rotor", contact.rotor);
  out.add("stator", "text", "the contact's stator", contact.stator);
  out.add("slave_area", "m2", "area of the surface whose nodes have the pairs; 0 for points", coverage.area);
  out.add("covered_area", "m2", "the part of it that faces the other surface", coverage.covered);
  out.add("closed_mismatch", "m", "largest distance that counts as none, without a reach", coverage.closed);
  out.add("offset", "m", "largest tangential distance of the places where a pair's two forces act", coverage.offset);
}

void add_part_mass(Entry out, const PartMass& part)
{
  out.brief("name", "text", "part of the scene", part.name);
  out.brief("mass", "kg", "mass of its elements", part.mass);
}

void add_model(Entry out, const Report& report)
{
  const ModelSummary& model = report.model;
  const StepCosts& costs = report.motion.cycle.costs;
  const double factor = std::max(report.transient.factor_seconds, costs.factor_seconds);
  out.brief("dofs", "-", "degrees of freedom", model.dofs);
  out.brief("elements", "-", "finite elements", model.elements);
  out.brief("pairs", "-", "contact pairs", model.pairs);
  out.brief("ranks", "-", "MPI ranks", model.ranks);
  if (out.has(model.length > 0)) out.brief("size", "m", "sides of the box round the mesh", model.size);
  out.list("parts", add_part_mass, model.parts);
  out.add("memory_bytes", "bytes", "largest memory that was resident, all ranks together", model.memory_bytes);
  out.add("rounding_hz", "Hz", "slower modes count as rigid: 1e-6 sqrt(norm(K)/norm(M))/2 pi", model.rounding_hz);
  out.list("contacts", add_coverage, out.scene().contacts, model.coverage);
  if (!out.has(factor > 0)) return; // A was factored: what one step size costs before the first step
  out.add("factor_seconds", "s", "time to factor A of the time step bordered by B, once a step size", factor);
  out.add("condensed_operator_seconds", "s", "time to prepare W, once a step size",
          std::max(report.transient.condensed_seconds, costs.condensed_seconds));
}

/// Run and scene, and what is heard.
void add_head(Entry out, const Report& report)
{
  out.add("format_version", "-", "of these keys and of the HDF5 data sets; readers refuse a later one", format_version);
  out.add("run", "text", "identity of the run in all files: start (UTC), machine, process", report.run);
  out.add("exit_code", "-", "with which the run ended; `null` in the results of a run that goes on",
          report.exit_code < 0 ? Json() : Json(report.exit_code));
  out.add("title", "text", "the scene's title", out.scene().title);
  out.add("scene", "path", "the scene file", out.scene().file.string());
  out.add("next", "text", "a command that goes on from here", next_command(report, out.scene()));
  out.add("heard", "text", "what is heard, and whether it lasts, in one sentence", heard(report, out.scene()));
}

/// Times of the run, and versions of what it ran on.
void add_tail(Entry out, const Report& report)
{
  const Entry clock = out.group("timings"), processor = out.group("processor_seconds"), of = out.group("versions");
  const auto add = [&](const char* stage, double seconds, double processor_seconds)
  {
    clock.add(stage, "s", "time of each stage by the clock", seconds);
    processor.add(stage, "s", "time of each stage by the processor of rank 0", processor_seconds);
  };
  for (const auto& [stage, seconds, processor_seconds] : report.timings) add(word(stage), seconds, processor_seconds);
  if (out.is_example()) add("<stage>", 0, 0);
  for (const auto& [name, version] :
       out.is_example() ? std::vector{std::pair<std::string, std::string>("<library>", "")} : versions())
    of.add(name, "text", "version of squeal and of each library", version);
}

/// Results of each stage, in the order of outcomes_of.
constexpr std::array add_found = {add_equilibrium, add_modes,       add_estimate, add_response,
                                  add_transient,   add_cycle,       add_settled,  add_attractors,
                                  add_branch,      add_sensitivity, add_sweep,    add_robustness};

void add_stage(Entry out, const Report& report, std::size_t number)
{
  const auto [stage, outcome] = outcomes_of(report)[number];
  const bool found = has_run(outcome) && outcome.kind != OutcomeKind::refused;
  if (!out.is_example()) add_outcome(out, outcome);
  if (out.has(found)) add_found[number](out, report);
  if (stage == Stage::cycle) add_attempts(out, report.motion.attempts);
}

/// The example has outcome and warnings but once, as of <stage>.
Result filled(const Report& report, const Scene& scene, Content content)
{
  Result root;
  const Entry out(root, scene, content);
  add_head(out, report);
  const Entry model = out.group(word(Stage::model));
  add_model(model, report);
  for (const std::string& sentence : report.model.warnings) model.warn(Severity::warning, sentence);
  if (out.is_example())
  {
    const Entry any = out.group("<stage>");
    add_outcome(any, {});
    any.add("warnings", "text", "sentences for whoever the numbers would mislead; also of `model`", Json::array());
    any.add("severities", "word", "how much each bears on the answer: `note`, `warning`, `severe`", Json::array());
  }
  for (std::size_t i = 0; i < add_found.size(); ++i)
  {
    add_stage(out.group(word(outcomes_of(report)[i].first)), report, i);
    if (outcomes_of(report)[i].first == Stage::settled) add_fidelity(out.group("fidelity"), report.motion.fidelity);
  }
  add_tail(out, report);
  return root;
}

/// A scene that asks for everything.
Scene full_scene()
{
  Scene scene;
  scene.branch.emplace();
  scene.sweep.emplace();
  scene.robustness.emplace();
  return scene;
}

std::string section(const std::string& file, const std::string& rows)
{
  return "\n### " + markdown_code(file) + "\n\n" + markdown_head({"name", "unit", "meaning"}) + rows;
}

} // namespace

Result results_of(const Report& report, const Scene& scene)
{
  return filled(report, scene, Content::results);
}

std::string report_json(const Report& report, const Scene& scene)
{
  // Text from files of any encoding must not stop the report.
  return json_of(results_of(report, scene)).dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string result_page()
{
  const Scene scene = full_scene();
  const Report none;
  const Result results = filled(none, scene, Content::example), modes = sweep_modes({}, scene, Content::example),
               samples = robustness_samples({}, scene, Content::example);
  return "# Results of a run\n\nsqueal writes this page: `squeal --reference results`. [RUNS.md](RUNS.md) says which "
         "files a run leaves, how to\njudge their numbers, and how an ended run goes on.\n\n`<name>` stands for any "
         "name of its kind, `[]` for the entries of a list. A number that does not exist is `null`. A stage\nthat "
         "was `off` or `skipped` has an outcome and a reason only. Outcomes are explained in the "
         "[README](../README.md#outcomes-and-exit-codes).\n" +
         section("report.json", page_rows(results)) + section("sweep.csv", page_rows(modes)) +
         section("robustness.csv", page_rows(samples)) + section("history.h5", page_rows(history_sets)) +
         section("fields.h5", page_rows(field_sets));
}

} // namespace squeal
