/// The table a person reads at the end of a run: the answer, a row for each stage, and the next command. In full, a row
/// for each result stands before.
#include "results.hpp"

#include <cctype>
#include <cmath>
#include <cstdio>

namespace squeal
{

namespace
{

using Kind = Result::Kind;
using Place = Result::Place;

constexpr std::size_t list_rows = 12, curve_rows = 24, list_groups = 3; // that are shown
constexpr int name_width = 27, value_width = 22, all_digits = 7;

std::string stage_row(const std::string& head, const std::string& text)
{
  return text.empty() ? "  " + head + "\n" : format("  %-12s ", head.c_str()) + text + "\n";
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

/// Whether anything of it is shown.
bool is_shown(const Result& result)
{
  return result.place != Place::none || std::ranges::any_of(result.parts, is_shown);
}

bool is_list(const Result& result)
{
  return (result.kind == Kind::list || result.kind == Kind::curve) && is_shown(result);
}

/// Places of the entries of a list that are shown: the first ones, of a curve some that are spread evenly.
std::vector<std::size_t> shown_places(const Result& list)
{
  const std::size_t size = list.parts.size(), most = list.kind == Kind::curve ? curve_rows : list_rows;
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < std::min(size, most); ++i)
    places.push_back(list.kind == Kind::curve && size > most ? i * (size - 1) / (most - 1) : i);
  return places;
}

/// A list as columns below their names and units.
std::string columns_text(const Result& list)
{
  const std::vector<std::size_t> places = shown_places(list);
  std::vector<std::string> rows(places.size() + 2);
  for (const Column& column : columns_of(list))
  {
    const Result& first = *column.first;
    if (first.place == Place::none) continue;
    const std::string unit = unit_text(first);
    std::vector<std::string> cells = {label(column.name), unit.empty() ? "" : "[" + unit + "]"};
    for (const std::size_t i : places)
      cells.push_back(column.cells[i] ? value_text(column.cells[i]->value, first, all_digits) : "");
    if (std::all_of(cells.begin() + 2, cells.end(), [](const std::string& cell) { return cell.empty(); })) continue;
    std::size_t width = 0;
    for (const std::string& cell : cells) width = std::max(width, cell.size());
    const bool is_text = first.unit == "text" || first.unit == "word";
    for (std::size_t i = 0; i < cells.size(); ++i)
    {
      const std::string space(width - cells[i].size(), ' ');
      rows[i] += "  " + (is_text ? cells[i] + space : space + cells[i]);
    }
  }
  std::string text;
  for (const std::string& row : rows)
    if (const std::size_t end = row.find_last_not_of(' '); end != std::string::npos)
      text += "    " + row.substr(0, end + 1) + "\n";
  if (places.size() < list.parts.size())
    text += format("      %zu of %zu; report.json has all\n", places.size(), list.parts.size());
  return text;
}

/// "    frequency   4840.5 Hz   meaning"; a text needs no meaning.
std::string value_row(const std::string& name, const Result& result, const Result* error, std::string meaning)
{
  std::string value = value_text(result.value, result, all_digits);
  if (value.empty()) return "";
  if (const std::string bar = error ? value_text(error->value, *error, all_digits) : ""; !bar.empty())
    value += " +- " + bar;
  if (const std::string unit = unit_text(result); !unit.empty()) value += " " + unit;
  std::erase(meaning, '`');
  return format("    %-*s ", name_width, name.c_str()) +
         (result.unit == "text" || meaning.empty() ? value : format("%-*s ", value_width, value.c_str()) + meaning) +
         "\n";
}

/// The shown parts of a group, each behind the names of the groups that it is in.
std::string group_text(const Result& group, const std::string& place)
{
  std::string text;
  std::string meaning; // of the row before: it is not said again
  for (auto part = group.parts.begin(); part != group.parts.end(); ++part)
  {
    const std::string name = place + (part->name == "mean" ? "" : (place.empty() ? "" : " ") + label(part->name));
    if (part->place == Place::row)
    {
      const auto next = std::next(part);
      const bool has_bar = next != group.parts.end() && next->place == Place::error_bar;
      text += value_row(name, *part, has_bar ? &*next : nullptr, meaning == part->meaning ? "" : part->meaning);
      meaning = part->meaning;
    }
    else if (part->kind == Kind::group)
      text += group_text(*part, name);
    else if (is_list(*part) && !std::ranges::any_of(part->parts.front().parts, is_list))
      text += "    " + name + "\n" + columns_text(*part);
    else if (is_list(*part))
      for (std::size_t i = 0; const Result& one : part->parts)
        if (i++ < list_groups) text += format("    %s %zu\n", name.c_str(), i) + group_text(one, "");
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

/// The warnings of a stage in one severity, or in all where it is empty.
std::vector<std::string> warnings_of(const Result& stage, const std::string& severity)
{
  std::vector<std::string> rows;
  const Result *sentences = stage.part("warnings"), *severities = stage.part("severities");
  for (std::size_t i = 0; sentences && i < sentences->value.size(); ++i)
    if (const std::string own = severities->value[i].get<std::string>(); severity.empty() || own == severity)
      rows.push_back(warning_row(own, sentences->value[i].get<std::string>()));
  return rows;
}

/// A stage with what is shown of it, and its warnings; nothing of one that is off.
std::string stage_text(const Result& stage)
{
  const Result* outcome = stage.part("outcome");
  const bool is_off = outcome && outcome->value == word(OutcomeKind::off);
  if (is_off || (!outcome && !is_shown(stage))) return "";
  std::string text = stage_row(stage.name, outcome ? outcome_text(*outcome, stage.part("reason")) : "");
  text += group_text(stage, "");
  for (const std::string& row : warnings_of(stage, "")) text += "    " + row;
  return text;
}

std::string timings_text(const Report& report)
{
  std::string text = stage_row("time", "");
  for (const auto& [stage, seconds, processor_seconds] : report.timings)
    if (seconds >= 0.01) text += format("    %-*s %.2f s\n", name_width, word(stage), seconds);
  return text;
}

/// The brief values of a group, "a text, name 1 unit"; of its groups behind their names.
std::string brief_values(const Result& group, const std::string& place)
{
  std::string text;
  const auto add = [&](const std::string& one) { text += (text.empty() || one.empty() ? "" : ", ") + one; };
  for (const Result& part : group.parts)
  {
    const std::string name = place + label(part.name), unit = unit_text(part);
    if (part.kind == Kind::group) add(brief_values(part, name + " "));
    if (!part.is_brief) continue;
    if (const std::string value = value_text(part.value, part, 5); !value.empty())
      add((part.value.is_string() ? "" : name + " ") + value + (unit.empty() ? "" : " " + unit));
  }
  return text;
}

/// The brief entries of a list, as many to a row as fit.
std::string brief_list(const Result& list)
{
  constexpr std::size_t width = 100, most = 3; // letters of a row; rows
  std::vector<std::string> rows;
  std::size_t entries = 0, shown = 0;
  for (const Result& one : list.parts)
  {
    const std::string values = brief_values(one, "");
    if (values.empty()) continue;
    ++entries;
    const bool fits = !rows.empty() && rows.back().size() + values.size() < width;
    if (!fits && rows.size() == most) continue;
    if (fits)
      rows.back() += "; " + values;
    else
      rows.push_back(values);
    ++shown;
  }
  if (shown < entries) rows.back() += format("; and %zu more", entries - shown);
  std::string text;
  for (const std::string& row : rows) text += stage_row("  " + (text.empty() ? label(list.name) : ""), row);
  return text;
}

/// The brief lists of a group and of the groups and lists in it.
std::string brief_lists(const Result& group)
{
  std::string text;
  for (const Result& part : group.parts)
    text += part.kind == Kind::list ? brief_list(part) : part.kind == Kind::group ? brief_lists(part) : "";
  return text;
}

/// A row for a stage that has run, and rows for its lists.
std::string brief_stage(const Result& stage)
{
  const Result* outcome = stage.part("outcome");
  if (outcome && (outcome->value == word(OutcomeKind::off) || outcome->value == word(OutcomeKind::skipped))) return "";
  std::string row = outcome ? outcome_text(*outcome, stage.part("reason")) : "";
  const std::string values = brief_values(stage, ""), lists = brief_lists(stage);
  row += (row.empty() || values.empty() ? "" : ", ") + values;
  return (row.empty() ? "" : stage_row(stage.name, row)) + lists;
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
  std::string text = std::to_string(passed) + (failed.empty() ? " passed" : " passed, FAILED: ");
  for (const std::string& name : failed) text += (&name == &failed.front() ? "" : ", ") + name;
  return stage_row("checks", text);
}

/// The severest first, and no more than a reader takes in.
std::string warnings_text(const Result& results)
{
  constexpr std::size_t most = 4;
  std::vector<std::string> rows;
  for (const Severity severity : {Severity::severe, Severity::warning, Severity::note})
    for (const Result& stage : results.parts)
      std::ranges::copy(warnings_of(stage, word(severity)), std::back_inserter(rows));
  std::string text;
  for (std::size_t i = 0; i < std::min(most, rows.size()); ++i) text += "  " + rows[i];
  return text + (rows.size() > most ? format("  %zu further remarks with --verbose\n", rows.size() - most) : "");
}

} // namespace

std::string table(const Report& report, const Scene& scene, TableLength length)
{
  const std::string title = "\n" + (scene.title.empty() ? scene.file.filename().string() : scene.title) + "\n";
  const Result results = results_of(report, scene);
  std::string stages, text = title;
  for (const Result& part : results.parts)
    if (part.kind == Kind::group)
    {
      if (length == TableLength::full) text += stage_text(part);
      stages += brief_stage(part);
    }
  if (length == TableLength::full) text += timings_text(report) + title;
  double seconds = 0;
  for (const Timing& timing : report.timings) seconds += timing.seconds;
  return text + stage_row("heard", heard(report, scene)) + stages + checks_text(results) + warnings_text(results) +
         stage_row("time", format("%.2f s", seconds)) + stage_row("next", next_command(report, scene));
}

void print_table(const Report& report, const Scene& scene, TableLength length, MPI_Comm comm)
{
  if (rank_of(comm) != 0) return;
  std::fputs(table(report, scene, length).c_str(), stdout);
  std::fflush(stdout);
}

} // namespace squeal
