#pragma once
/// A result with its name, unit, meaning and value. A tree of results is what report.json, the printed table, CSV
/// files and the page inputs/RESULTS.md are written from.
#include "squeal/base/words.hpp"
#include "squeal/report/report.hpp"
#include "squeal/scene/scene.hpp"
#include "squeal/settled/motion.hpp"

#include <algorithm>
#include <list>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace squeal
{

using Json = nlohmann::ordered_json;

/// How much a warning bears on the answer.
enum class Severity
{
  note,    // what the numbers leave open
  warning, // a number may be off
  severe,  // the answer may be of something else
};

template <> inline constexpr std::array words_of<Severity> = {"note", "warning", "severe"};

/// A value, a group of results, or a list of groups.
struct Result
{
  enum class Kind
  {
    value,
    group,
    list,
  };
  /// Place of a value in the printed table.
  enum class Place
  {
    none,
    row,
    error_bar, // behind the value before
  };

  Kind kind = Kind::group;
  std::string name{}, unit{};
  const char* meaning = "";
  Json value{};
  std::list<Result> parts{};
  Words words{}; // of which the value is one
  Place place = Place::none;
  bool is_brief = false;        // the short table shows it, too
  std::optional<bool> passed{}; // of a check

  /// The part of this name; null: there is none.
  const Result* part(const std::string& of) const;
};

/// The content that a tree is filled with.
enum class Content
{
  results,
  example, // everything that may ever be written, once: for the page
};

/// A group that is being filled with results of a scene.
class Entry
{
public:
  Entry(Result& at, const Scene& scene, Content content) : at_(at), scene_(scene), content_(content) {}

  const Scene& scene() const { return scene_; }
  bool is_example() const { return content_ == Content::example; }

  /// Whether what exists on this condition is to be added.
  bool has(bool condition) const { return condition || is_example(); }

  Result& add(const std::string& name, const std::string& unit, const char* meaning, Json value) const;

  /// A value that is one of its enum's words.
  template <class Enum> Result& add(const std::string& name, const char* meaning, Enum value) const
  {
    Result& result = add(name, "word", meaning, word(value));
    result.words = words_of<Enum>;
    return result;
  }

  /// A result that the table shows as well, described as by `add`.
  template <class... Description> Result& show(const std::string& name, const Description&... description) const
  {
    Result& result = add(name, description...);
    result.place = shown_ ? Result::Place::row : Result::Place::none;
    return result;
  }

  /// A result that the short table shows as well.
  template <class... Description> Result& brief(const std::string& name, const Description&... description) const
  {
    Result& result = show(name, description...);
    result.is_brief = shown_;
    return result;
  }

  /// A result that tells whether others can be trusted; the short table names those that did not pass. `passed`: none
  /// where nothing rests on it.
  template <class... Description>
  void check(std::optional<bool> passed, const std::string& name, const Description&... description) const
  {
    Result& result = show(name, description...);
    if (shown_) result.passed = passed;
  }

  /// This group, filled with results that the table leaves out and that bring no warnings.
  Entry hidden() const;

  /// The error bar of the result before, in its unit.
  Result& error(const std::string& name, const char* meaning, double value) const;

  /// A text that is left out where it is empty.
  void text(const std::string& name, const char* meaning, const std::string& value) const;

  /// A sentence for whoever would be misled by the numbers.
  void warn(Severity severity, const std::string& sentence) const;

  /// A mean with its error bar.
  void mean(const std::string& name, const std::string& unit, const char* meaning, const MeanValue& value) const;

  Entry group(const std::string& name) const;

  /// An empty list, to which groups without a name are added.
  Entry list(const std::string& name) const;

  /// A group for each item of these lists, which are as long as the shortest.
  template <class Fill, class... Items>
  void list(const std::string& name, Fill fill, const std::vector<Items>&... items) const
  {
    const Entry entry = list(name);
    for (std::size_t i = 0; i < std::min({items.size()...}); ++i) fill(entry.group(""), items[i]...);
    if (is_example()) fill(entry.group(""), Items{}...);
  }

private:
  Result& at_;
  const Scene& scene_;
  Content content_;
  bool shown_ = true;
};

/// The tree as JSON.
Json json_of(const Result& result);

/// A list of groups of values as CSV: a head, and a line a group. What is not known, or is a list, is empty.
std::string csv_of(const Result& list);

/// Rows of the page: name, unit and meaning of each value.
std::string page_rows(const Result& result);

// All results of a run as one tree (report/result.hpp), and the rows of tables that report.json leaves out.

/// The tree of report.json.
Result results_of(const Report& report, const Scene& scene);

/// A group for each mode of each point of a sweep, one without a mode for a point that failed.
Result sweep_modes(const Sweep& sweep, const Scene& scene, Content content);

/// A group for each random sample.
Result robustness_samples(const Robustness& robustness, const Scene& scene, Content content);

/// Adds one value a probe in a group of this name.
void add_probes(Entry out, const std::string& name, const char* meaning, const std::vector<double>& values);

/// Adds the values of multipliers with their errors.
void add_multipliers(Entry out, const char* name, const Multipliers& multipliers);

/// Adds the key of a number with the name that it has.
void add_key(Entry out, const char* meaning, const std::string& key);

// Each adds the results of a stage that has run.
void add_equilibrium(Entry out, const Report& report);
void add_modes(Entry out, const Report& report);
void add_estimate(Entry out, const Report& report);
void add_response(Entry out, const Report& report);
void add_transient(Entry out, const Report& report);
void add_cycle(Entry out, const Report& report);
void add_settled(Entry out, const Report& report);
void add_attractors(Entry out, const Report& report);
void add_branch(Entry out, const Report& report);
void add_sensitivity(Entry out, const Report& report);
void add_sweep(Entry out, const Report& report);
void add_robustness(Entry out, const Report& report);

/// Adds the attempts of the search for a motion, with why each ended.
void add_attempts(Entry out, const std::vector<Attempt>& attempts);

/// Adds the model on which the cycle was sought.
void add_fidelity(Entry out, const Fidelity& fidelity);

} // namespace squeal
