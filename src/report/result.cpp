#include "result.hpp"

#include "squeal/base/error.hpp"
#include "squeal/base/markdown.hpp"

#include <cmath>

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

} // namespace squeal
