#include "result.hpp"
#include "files.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/markdown.hpp"

#include <array>
#include <cmath>
#include <utility>

namespace squeal
{

namespace
{

std::string csv_text(const std::string& text)
{
  std::string quoted = "\"";
  for (const char letter : text) quoted += letter == '"' ? "\"\"" : std::string(1, letter);
  return quoted + "\"";
}

std::string csv_cell(const Result* result)
{
  const Json value = result ? result->value : Json();
  if (value.is_string()) return csv_text(value.get<std::string>());
  if (value.is_boolean()) return value.get<bool>() ? "1" : "0";
  if (!value.is_number_float()) return value.is_null() ? "" : value.dump();
  return std::isfinite(value.get<double>()) ? format("%.17g", value.get<double>()) : "";
}

/// "`one`, `another`", without the empty word.
std::string words_text(Words words)
{
  std::string text;
  for (const std::string one : words)
    if (!one.empty()) text += (text.empty() ? "" : ", ") + markdown_code(one);
  return text;
}

void add_page_rows(const Result& result, const std::string& place, std::string& rows)
{
  const std::string name = place + (place.empty() || result.name.empty() ? "" : ".") + result.name;
  if (result.kind == Result::Kind::value)
    rows += markdown_row({markdown_code(name + (result.value.is_array() ? "[]" : "")), result.unit,
                          result.meaning + (result.words.empty() ? "" : ": " + words_text(result.words))});
  for (const Result& part : result.parts)
    add_page_rows(part, name + (result.kind == Result::Kind::list ? "[]" : ""), rows);
}

} // namespace

const Result* Result::part(const std::string& of) const
{
  const auto found = std::ranges::find(parts, of, &Result::name);
  return found == parts.end() ? nullptr : &*found;
}

Result& Entry::add(const std::string& name, const std::string& unit, const char* meaning, Json value) const
{
  return at_.parts.emplace_back(Result{Result::Kind::value, name, unit, meaning, std::move(value)});
}

Result& Entry::error(const std::string& name, const char* meaning, double value) const
{
  Result& result = add(name, at_.parts.back().unit, meaning, value);
  if (shown_) result.place = Result::Place::error_bar;
  return result;
}

Entry Entry::hidden() const
{
  Entry entry = *this;
  entry.shown_ = false;
  return entry;
}

void Entry::text(const std::string& name, const char* meaning, const std::string& value) const
{
  if (has(!value.empty())) show(name, "text", meaning, value);
}

void Entry::warn(Severity severity, const std::string& sentence) const
{
  if (is_example() || !shown_) return;
  const auto push = [&](const char* name, const std::string& text)
  {
    if (!at_.part(name)) add(name, "text", "", Json::array());
    std::ranges::find(at_.parts, name, &Result::name)->value.push_back(text);
  };
  push("warnings", sentence);
  push("severities", word(severity));
}

void Entry::mean(const std::string& name, const std::string& unit, const char* meaning, const MeanValue& value) const
{
  const Entry entry = group(name);
  entry.show("mean", unit, meaning, value.value);
  entry.error("error", "its error bar of 95 %", value.error);
}

Entry Entry::list(const std::string& name) const
{
  const Entry entry = group(name);
  entry.at_.kind = Result::Kind::list;
  return entry;
}

Entry Entry::group(const std::string& name) const
{
  Entry entry(at_.parts.emplace_back(Result{Result::Kind::group, name}), scene_, content_);
  entry.shown_ = shown_;
  return entry;
}

Json json_of(const Result& result)
{
  if (result.kind == Result::Kind::value) return result.value;
  Json json = result.kind == Result::Kind::group ? Json::object() : Json::array();
  for (const Result& part : result.parts)
    if (result.kind == Result::Kind::group)
      json[part.name] = json_of(part);
    else
      json.push_back(json_of(part));
  return json;
}

std::string csv_of(const Result& list)
{
  std::vector<std::string> names; // of all groups
  for (const Result& group : list.parts)
    for (const Result& part : group.parts)
      if (!part.value.is_array() && std::ranges::find(names, part.name) == names.end()) names.push_back(part.name);
  std::string text;
  for (const std::string& name : names) text.append(text.empty() ? "" : ",").append(csv_text(name));
  for (const Result& group : list.parts)
    for (std::size_t i = 0; i < names.size(); ++i)
      text.append(i == 0 ? "\n" : ",").append(csv_cell(group.part(names[i])));
  return text + "\n";
}

std::string page_rows(const Result& result)
{
  std::string rows;
  for (const Result& part : result.parts) add_page_rows(part, "", rows);
  return rows;
}

// The tree of all results, report.json, and the page of results.

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
