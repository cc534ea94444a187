#pragma once
/// Rows of Markdown tables.
#include <string>
#include <vector>

namespace squeal
{

/// A row of a table; characters that would end a cell or begin a tag are escaped.
std::string markdown_row(const std::vector<std::string>& cells);

/// The head of a table with these columns.
std::string markdown_head(const std::vector<std::string>& columns);

/// The text as code; empty stays empty.
std::string markdown_code(const std::string& text);

} // namespace squeal
