/// The table a person reads at the end of a run: the answer, rows for each stage, and the next command.
#include "result.hpp"

#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstdio>

namespace squeal
{

namespace
{

using Kind = Result::Kind;
using Place = Result::Place;

constexpr std::size_t width = 100; // letters of a row

/// The extent of a table.
struct Shown
{
  bool all = false;         // of the results that a person reads; else the brief ones
  std::size_t rows = 3;     // of a list
  std::size_t warnings = 4; // no more than a reader takes in
  int digits = 5;
};

constexpr Shown shown_in(TableLength length)
{
  return length == TableLength::full ? Shown{true, 12, SIZE_MAX, 7} : Shown{};
}

std::string row(const std::string& head, const std::string& text)
{
  return format("  %-12s ", head.c_str()) + text + "\n";
}

/// Pieces in rows, as many to a row as fit.
std::vector<std::string> packed_rows(const std::vector<std::string>& pieces, const std::string& separator)
{
  std::vector<std::string> rows;
  for (const std::string& piece : pieces)
    if (!rows.empty() && rows.back().size() + piece.size() < width)
      rows.back() += separator + piece;
    else
      rows.push_back(piece);
  return rows;
}

/// Rows behind one head.
std::string rows_text(const std::string& head, const std::vector<std::string>& rows)
{
  std::string text;
  for (const std::string& one : rows) text += row(text.empty() ? head : "", one);
  return text;
}

/// A name in words, without its unit.
std::string label(const std::string& name)
{
  std::string text = name;
  if (const std::size_t at = text.find("_hz"); at != std::string::npos) text.erase(at, 3);
  std::ranges::replace(text, '_', ' ');
  return text;
}

/// A unit that a number is followed by; empty for words and pure numbers.
std::string unit_text(const Result& result)
{
  constexpr std::array silent = {"-", "text", "word", "switch", "unit of the key", "units of the keys"};
  return std::ranges::count(silent, result.unit) > 0 ? "" : result.unit;
}

/// A value without its unit; empty where it is not known. `digits`: of a number.
std::string value_text(const Json& value, const Result& result, int digits)
{
  std::string text;
  if (value.is_array())
    for (const Json& one : value) text += (text.empty() ? "" : ", ") + value_text(one, result, digits);
  else if (value.is_boolean())
    text = value.get<bool>() ? "yes" : "no";
  else if (value.is_string())
    text = value.get<std::string>();
  else if (value.is_number_integer())
    text = value.dump();
  else if (value.is_number() && std::isfinite(value.get<double>()))
  {
    const double number = value.get<double>();
    const bool is_small = number != 0 && std::abs(number) < 1e-3 && result.unit == "-"; // a residual, mostly
    text = result.place == Place::error_bar || is_small ? format("%.1e", number) : format("%.*g", digits, number);
  }
  return text;
}

/// "converged", "NOT CONVERGED: reason": what is not a success must not look like one.
std::string outcome_text(const Result& outcome, const Result* reason)
{
  std::string text = outcome.value.get<std::string>();
  const auto kind = std::ranges::find_if(outcome.words, [&](const char* one) { return text == one; });
  if (!succeeded(Outcome{static_cast<OutcomeKind>(kind - outcome.words.begin()), "", 0, 0}))
    std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::toupper(c); });
  return text + (reason ? ": " + reason->value.get<std::string>() : "");
}

/// A warning behind the word of its severity, which stands in capitals where a number may be off.
std::string warning_row(const std::string& severity, const std::string& sentence)
{
  std::string head = severity;
  if (severity != word(Severity::note))
    std::ranges::transform(head, head.begin(), [](unsigned char c) { return std::toupper(c); });
  return head + ": " + sentence + "\n";
}

/// The warnings of a stage in one severity.
std::vector<std::string> warnings_of(const Result& stage, const std::string& severity)
{
  std::vector<std::string> rows;
  const Result *sentences = stage.part("warnings"), *severities = stage.part("severities");
  for (std::size_t i = 0; sentences && i < sentences->value.size(); ++i)
    if (const std::string own = severities->value[i].get<std::string>(); own == severity)
      rows.push_back(warning_row(own, sentences->value[i].get<std::string>()));
  return rows;
}

/// The shown values of a group, "a text" or "name 1 unit +- error"; of its groups behind their names.
std::vector<std::string> values_of(const Result& group, const std::string& place, const Shown& shown)
{
  std::vector<std::string> values;
  bool is_last_shown = false;
  for (const Result& part : group.parts)
  {
    const std::string name = place + (part.name == "mean" && !place.empty() ? "" : label(part.name) + " ");
    if (part.kind == Kind::group) std::ranges::copy(values_of(part, name, shown), std::back_inserter(values));
    const std::string value = part.place == Place::none ? "" : value_text(part.value, part, shown.digits),
                      unit = unit_text(part);
    if (part.place == Place::error_bar && is_last_shown && !value.empty()) values.back() += " +- " + value;
    if (part.place == Place::error_bar) continue;
    is_last_shown = !value.empty() && (shown.all || part.is_brief);
    if (is_last_shown)
      values.push_back((part.value.is_string() && !shown.all ? "" : name) + value + (unit.empty() ? "" : " " + unit));
  }
  return values;
}

std::string joined(const std::vector<std::string>& pieces)
{
  std::string text;
  for (const std::string& piece : pieces) text += (text.empty() ? "" : ", ") + piece;
  return text;
}

std::string lists_text(const Result& group, const Shown& shown);

/// The entries of a list, several to a row; of a full table each in a row of its own, with the lists in it.
std::string list_text(const Result& list, const Shown& shown)
{
  std::vector<std::string> entries, inner;
  for (const Result& one : list.parts)
    if (const std::string values = joined(values_of(one, "", shown)); !values.empty())
    {
      entries.push_back(values);
      inner.push_back(shown.all ? lists_text(one, shown) : "");
    }
  std::vector<std::string> rows = shown.all ? entries : packed_rows(entries, "; ");
  if (rows.size() > shown.rows) rows[shown.rows - 1] += "; and more, in report.json";
  std::string text;
  for (std::size_t i = 0; i < std::min(shown.rows, rows.size()); ++i)
    text += row("  " + (i == 0 ? label(list.name) : ""), rows[i]) + (shown.all ? inner[i] : "");
  return text;
}

/// The lists of a group and of the groups in it.
std::string lists_text(const Result& group, const Shown& shown)
{
  std::string text;
  for (const Result& part : group.parts)
    text += part.kind == Kind::list ? list_text(part, shown) : part.kind == Kind::group ? lists_text(part, shown) : "";
  return text;
}

/// Rows of a stage: its values, and its lists. A stage that is off has none, in the brief table one that was skipped.
std::string stage_text(const Result& stage, const Shown& shown)
{
  const Result* outcome = stage.part("outcome");
  const auto is = [&](OutcomeKind kind) { return outcome && outcome->value == word(kind); };
  if (is(OutcomeKind::off) || (!shown.all && is(OutcomeKind::skipped))) return "";
  std::vector<std::string> values = values_of(stage, "", shown);
  if (outcome) values.insert(values.begin(), outcome_text(*outcome, stage.part("reason")));
  return rows_text(stage.name, packed_rows(values, ", ")) + lists_text(stage, shown);
}

/// Counts the checks of a tree that were made, and names those that did not pass.
void count_checks(const Result& group, const std::string& place, int& passed, std::vector<std::string>& failed)
{
  for (const Result& part : group.parts)
  {
    const std::string name = place + label(part.name);
    count_checks(part, part.kind == Kind::group ? name + " " : place, passed, failed);
    const std::string value = part.passed ? value_text(part.value, part, 5) : "";
    if (value.empty()) continue;
    passed += *part.passed;
    if (!*part.passed) failed.push_back(name + " " + value);
  }
}

std::string checks_text(const Result& results)
{
  int passed = 0;
  std::vector<std::string> failed;
  count_checks(results, "", passed, failed);
  return row("checks", std::to_string(passed) + " passed" + (failed.empty() ? "" : ", FAILED: " + joined(failed)));
}

/// The severest first.
std::string warnings_text(const Result& results, const Shown& shown)
{
  std::vector<std::string> rows;
  for (const Severity severity : {Severity::severe, Severity::warning, Severity::note})
    for (const Result& stage : results.parts)
      std::ranges::copy(warnings_of(stage, word(severity)), std::back_inserter(rows));
  std::string text;
  for (std::size_t i = 0; i < std::min(shown.warnings, rows.size()); ++i) text += "  " + rows[i];
  return text + (rows.size() > shown.warnings
                     ? format("  %zu further remarks with --verbose\n", rows.size() - shown.warnings)
                     : "");
}

std::string timings_text(const Report& report, const Shown& shown)
{
  double whole = 0;
  std::vector<std::string> parts;
  for (const auto& [stage, seconds, processor_seconds] : report.timings)
  {
    whole += seconds;
    if (shown.all && seconds >= 0.01) parts.push_back(format("%s %.2f s", word(stage), seconds));
  }
  parts.insert(parts.begin(), format("%.2f s", whole));
  return rows_text("time", packed_rows(parts, ", "));
}

} // namespace

std::string table(const Report& report, const Scene& scene, TableLength length)
{
  const Shown shown = shown_in(length);
  const Result results = results_of(report, scene);
  std::string text = "\n" + (scene.title.empty() ? scene.file.filename().string() : scene.title) + "\n" +
                     row("heard", heard(report, scene));
  for (const Result& part : results.parts)
    if (part.kind == Kind::group) text += stage_text(part, shown);
  return text + checks_text(results) + warnings_text(results, shown) + timings_text(report, shown) +
         row("next", next_command(report, scene));
}

void print_table(const Report& report, const Scene& scene, TableLength length, MPI_Comm comm)
{
  if (rank_of(comm) != 0) return;
  std::fputs(table(report, scene, length).c_str(), stdout);
  std::fflush(stdout);
}

} // namespace squeal
