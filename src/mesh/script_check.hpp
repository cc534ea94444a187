#pragma once
/// The statements that a geometry may hold. A word is allowed if it is one of gmsh's listed words, or a name that the
/// script itself defines. A statement that begins with such a name must be an assignment: gmsh takes any other name
/// before a text for a command. Names before a text in brackets are refused, since they would be functions.
#include "script_tokens.hpp"

namespace squeal
{

/// Throws Error for the first statement that a geometry may not hold. `constants`: names in DefineConstant lists.
void check_statements(const Tokens& tokens, const std::vector<std::string>& constants);

} // namespace squeal
