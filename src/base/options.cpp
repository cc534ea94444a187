#include "squeal/base/options.hpp"

#include <charconv>
#include <cmath>
#include <optional>

namespace squeal
{

namespace
{

struct Bounds
{
  bool (*hold)(double);
  const char* text;
};

/// The test and the text of a range; every number must be finite as well.
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
  case Range::below_two:
    return {[](double x) { return x >= 0 && x < 2; }, "at least 0 and below 2"};
  case Range::any:
    break;
  }
  return {[](double) { return true; }, "a finite number"};
}

/// The option's text in the database, empty where it has no value.
std::optional<std::string> text_of(const Option& option)
{
  char text[256] = "";
  PetscBool given = PETSC_FALSE;
  check(PetscOptionsGetString(nullptr, nullptr, option.name.c_str(), text, sizeof text, &given));
  return given ? std::optional<std::string>(text) : std::nullopt;
}

[[noreturn]] void refuse(const Option& option, const std::string& text, const std::string& expected)
{
  throw Error("option " + option.name + " = " + text + " must be " + expected + "; it is: " + option.meaning);
}

/// Reads a number; PETSc's own reading lets whole numbers overflow.
template <class Number>
void read_number(const Option& option, const std::string& text, Number* member, const char* kind)
{
  const char* const first = text.data() + (text.starts_with('+') ? 1 : 0);
  const char* const last = text.data() + text.size();
  const auto [end, problem] = std::from_chars(first, last, *member);
  const bool fits = problem == std::errc() && end == last && std::isfinite(static_cast<double>(*member));
  if (!fits) refuse(option, text, kind);
  if (const Bounds bounds = bounds_of(option.range); !bounds.hold(static_cast<double>(*member)))
    refuse(option, text, bounds.text);
}

void read(const Option& option, const std::string& text, PetscInt* member)
{
  read_number(option, text, member, sizeof(PetscInt) == 8 ? "a whole number" : "a whole number of at most 2147483647");
}

void read(const Option& option, const std::string& text, double* member)
{
  read_number(option, text, member, "a finite number");
}

void read(const Option& option, const std::string& text, bool* member)
{
  *member = text.empty() || text == "true";
  if (!*member && text != "false") refuse(option, text, "true or false");
}

void read(const Option& option, const std::string& text, const Choice& member)
{
  std::string all;
  for (std::size_t place = 0; place < member.words.size(); ++place)
  {
    if (text == member.words[place]) return member.set(member.member, place);
    all += (all.empty() ? "" : ", ") + std::string(member.words[place]);
  }
  refuse(option, text, "one of " + all);
}

} // namespace

void read_options(const OptionList& options)
{
  for (const Option& option : options)
    if (const auto text = text_of(option))
      std::visit([&](const auto& member) { read(option, *text, member); }, option.member);
}

std::string value_of(const Option& option)
{
  if (const auto* member = std::get_if<PetscInt*>(&option.member)) return std::to_string(**member);
  if (const auto* member = std::get_if<double*>(&option.member)) return format("%g", **member);
  if (const auto* member = std::get_if<bool*>(&option.member)) return **member ? "true" : "false";
  const Choice& choice = std::get<Choice>(option.member);
  return choice.words[choice.get(choice.member)];
}

Words choices_of(const Option& option)
{
  const Choice* choice = std::get_if<Choice>(&option.member);
  return choice ? choice->words : Words{};
}

} // namespace squeal
