#pragma once
/// Options of PETSc's database as described members of plain structs, whose member initialisers are the only defaults.
/// src/options.cpp has the program's table, which is read and checked before the first stage.
#include "squeal/base/petsc.hpp"
#include "squeal/base/words.hpp"

#include <string>
#include <variant>
#include <vector>

namespace squeal
{

/// The numbers that an option may take.
enum class Range
{
  any,
  positive,     // x > 0
  not_negative, // x >= 0
  natural,      // x >= 1
  below_two,    // 0 <= x < 2
};

/// An option: its name, the member that it sets, what it may be, and what it means.
struct Option
{
  std::string name; // with its dash and prefix: "-transient_contact_tolerance"
  std::variant<PetscInt*, double*, bool*, Choice> member;
  Range range;
  std::string meaning;
};

using OptionList = std::vector<Option>;

/// Fills the members of the options that the database holds. Error: a value that cannot be read, or that is outside
/// its range, with the option, the value and what it may be.
void read_options(const OptionList& options);

/// The value that an option's member holds, as one would write it.
std::string value_of(const Option& option);

/// The words that an option may take; empty for numbers and switches.
Words choices_of(const Option& option);

} // namespace squeal
