#pragma once
/// Values that a user gives, described once: the member that each fills, its unit, rule, meaning, and its effect on the
/// model. Keys of a scene, options and arguments of the command line are described so.
#include "squeal/scene/numbers.hpp"

#include <functional>
#include <variant>

namespace squeal
{

/// A number or a table of an optional part. Setting one of them creates the part.
template <class Part, class Member> struct MemberTarget
{
  std::optional<Part>* part;
  Member Part::*member;
};

using DampingTarget = MemberTarget<RayleighDamping, double>;
using FrictionTarget = MemberTarget<FrictionLaw, double>;
using FrictionTableTarget = MemberTarget<FrictionLaw, FactorTable>;

/// The start of a motion: one of the words, or a state file, which the last word stands for.
struct StartTarget
{
  Choice kind;
  std::filesystem::path* file;
};

/// How a table is written.
enum class TableForm
{
  single, // [key]
  list,   // [[key]]
  braces, // key = { … }
};

struct TableEntry;

/// Tables of further keys: one that is always there, one that may be missing, or a list.
struct TableTarget
{
  TableForm form{};
  std::function<std::size_t()> size;
  std::function<void(std::size_t)> resize; // makes entries with the defaults of tables that a file has
  std::function<TableEntry(std::size_t)> entry;
};

/// The member that a key fills.
using Target = std::variant<double*, int*, long*, bool*, std::string*, std::filesystem::path*, Vec3*,
                            std::optional<Vec3>*, std::vector<Vec3>*, std::vector<std::string>*, std::vector<double>*,
                            std::array<double, 6>*, Motions*, std::map<std::string, double>*, FactorTable*,
                            DampingTarget, FrictionTarget, FrictionTableTarget, StartTarget, Choice, TableTarget>;

/// Whether a key must be given.
enum class Need
{
  optional,
  required,
};

/// Condition on a value. In addition every number must be finite.
enum class Rule
{
  any,
  positive,
  not_negative,
  poisson,   // in (-1, 0.5)
  fraction,  // in (0, 1]
  direction, // a vector that is normalised, or "x", "-y" and so on
  velocity,  // a vector; zero: none
  inertia,   // moments xx, yy, zz, none negative, and products
  file,      // an existing file
  folder,    // an existing folder
  below_two, // in [0, 2)
};

/// The studies that take a number by default, where the scene names none.
enum class Study
{
  nothing,
  derive,            // eigenvalues, by it
  double_it,         // to see what its component holds: mass and stiffness are linear in it
  derive_and_double, // both
};

struct SceneKey
{
  SceneKey() = default;

  /// `properties`: Need, Rule, Effect and Study where they are not the first ones.
  template <class... Properties>
  SceneKey(const char* name_, Target target_, const char* unit_, const char* meaning_, Properties... properties)
      : name(name_), target(std::move(target_)), unit(unit_), meaning(meaning_)
  {
    (take(properties), ...);
  }

  std::string name;
  Target target;
  std::string unit; // a physical unit, or a word for the kind of value
  std::string meaning;
  Need need{};
  Rule rule{};
  Effect effect{}; // of a number
  Study study{};   // of a number

private:
  void take(Need property) { need = property; }
  void take(Rule property) { rule = property; }
  void take(Effect property) { effect = property; }
  void take(Study property) { study = property; }
};

using SceneKeys = std::vector<SceneKey>;

/// One entry of a table.
struct TableEntry
{
  const void* member; // that the entry is
  std::string name;   // of its key `name`; empty: it has none
  std::string title;  // its name, or what it is between or on
  SceneKeys keys;
};

/// Sets the member of an option or argument by the word that was given; a list gains the word, and no word switches on.
/// `place` begins the message of the Error for a word that is not of its kind, or outside its rule.
void set_by_word(const std::string& place, const SceneKey& key, const std::string& word);

/// The value of an option as one would write it on the command line.
std::string word_of_value(const SceneKey& key);

} // namespace squeal
