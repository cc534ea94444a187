#pragma once
/// The words of gmsh's language.
#include <string_view>

namespace squeal
{

/// Whether a geometry may use this word of gmsh's.
bool is_allowed_word(std::string_view word);

/// Whether gmsh gives this word a meaning, so that no variable can have it for a name.
bool is_reserved_word(std::string_view word);

/// Whether a geometry may set this member of the options General.
bool is_allowed_general_option(std::string_view name);

/// Whether a geometry may set this option to a text; the texts of some others are commands.
bool is_allowed_text_option(std::string_view name);

} // namespace squeal
