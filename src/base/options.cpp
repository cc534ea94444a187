#include "squeal/base/options.hpp"

#include <charconv>
#include <cmath>

namespace squeal
{

namespace
{

struct Bounds
{
  bool (*hold)(double);
  const char* text;
};

/// What the range holds; every number must be finite as well.
Bounds bounds_of(Range range)
{
  switch (range)
  {
  case Range::positive:
    return {[](double x) { return x > 0; }, "above 0"};
  case Range::not_negative:
    return {[](double x) { return x >= 0; }, "at least 0"};
  case Range::natural:
    return {[](double x) { return x >= 1; }, "at least 1"};
  case Range::up_to_two:
    return {[](double x) { return x >= 0 && x <= 2; }, "from 0 to 2"};
  case Range::inside_two:
    return {[](double x) { return x > 0 && x < 2; }, "above 0 and below 2"};
  case Range::below_two:
    return {[](double x) { return x >= 0 && x < 2; }, "at least 0 and below 2"};
  case Range::any:
    break;
  }
  return {[](double) { return true; }, "a finite number"};
}

/// The option's text in the database; empty if it is not there.
std::string text_of(const Option& option)
{
  char text[256] = "";
  PetscBool given = PETSC_FALSE;
  check(PetscOptionsGetString(nullptr, nullptr, option.name.c_str(), text, sizeof text, &given));
  return given ? text : "";
}

[[noreturn]] void refuse(const Option& option, const std::string& expected)
{
  throw Error("option " + option.name + " = " + text_of(option) + " must be " + expected +
              "; it is: " + option.meaning);
}

/// Converts by the library, whose complaint names neither the option nor what it may be.
template <class Convert> void convert(const Option& option, const char* kind, Convert library_call)
{
  check(PetscPushErrorHandler(PetscIgnoreErrorHandler, nullptr));
  const PetscErrorCode code = library_call();
  check(PetscPopErrorHandler());
  if (code != PETSC_SUCCESS) refuse(option, kind);
}

/// Reads a number; PETSc's own reading lets whole numbers overflow. Leaves the member where the option is not given.
template <class Number> void read_number(const Option& option, Number* member, const char* kind)
{
  PetscBool given = PETSC_FALSE;
  check(PetscOptionsHasName(nullptr, nullptr, option.name.c_str(), &given));
  if (!given) return;
  const std::string text = text_of(option);
  const char* const first = text.data() + (text.starts_with('+') ? 1 : 0);
  const char* const last = text.data() + text.size();
  const auto [end, problem] = std::from_chars(first, last, *member);
  const bool fits = problem == std::errc() && end == last && std::isfinite(static_cast<double>(*member));
  if (!fits) refuse(option, kind);
  if (const Bounds bounds = bounds_of(option.range); !bounds.hold(static_cast<double>(*member)))
    refuse(option, bounds.text);
}

void read(const Option& option, PetscInt* member)
{
  read_number(option, member, sizeof(PetscInt) == 8 ? "a whole number" : "a whole number of at most 2147483647");
}

void read(const Option& option, double* member)
{
  read_number(option, member, "a finite number");
}

void read(const Option& option, bool* member)
{
  const char* name = option.name.c_str();
  PetscBool value = *member ? PETSC_TRUE : PETSC_FALSE;
  convert(option, "true or false", [&] { return PetscOptionsGetBool(nullptr, nullptr, name, &value, nullptr); });
  *member = value == PETSC_TRUE;
}

void read(const Option& option, const Choice& member)
{
  const std::string given = text_of(option);
  PetscBool present = PETSC_FALSE;
  check(PetscOptionsHasName(nullptr, nullptr, option.name.c_str(), &present));
  if (!present) return;
  std::string all;
  for (std::size_t place = 0; place < member.words.size(); ++place)
  {
    if (given == member.words[place])
    {
      member.set(member.member, place);
      return;
    }
    all += (all.empty() ? "" : ", ") + std::string(member.words[place]);
  }
  refuse(option, "one of " + all);
}

} // namespace

void read_options(const OptionList& options)
{
  for (const Option& option : options) std::visit([&](const auto& member) { read(option, member); }, option.member);
}

std::string value_of(const Option& option)
{
  if (const auto* member = std::get_if<PetscInt*>(&option.member)) return std::to_string(**member);
  if (const auto* member = std::get_if<double*>(&option.member)) return format("%g", **member);
  if (const auto* member = std::get_if<bool*>(&option.member)) return **member ? "true" : "false";
  const Choice& choice = std::get<Choice>(option.member);
  return choice.words[choice.get(choice.member)];
}

Words words_of(const Option& option)
{
  const Choice* choice = std::get_if<Choice>(&option.member);
  return choice ? choice->words : Words{};
}

} // namespace squeal
