#include "squeal/base/markdown.hpp"

namespace squeal
{

std::string markdown_row(const std::vector<std::string>& cells)
{
  std::string row = "|";
  for (const std::string& cell : cells)
  {
    row += ' ';
    bool is_code = false;
    for (const char letter : cell)
    {
      is_code ^= letter == '`';
      if (letter == '|' || (letter == '<' && !is_code)) row += '\\';
      row += letter;
    }
    row += cell.empty() ? "|" : " |";
  }
  return row + "\n";
}

std::string markdown_head(const std::vector<std::string>& columns)
{
  std::string rule = "|";
  for (std::size_t i = 0; i < columns.size(); ++i) rule += "---|";
  return markdown_row(columns) + rule + "\n";
}

std::string markdown_code(const std::string& text)
{
  return text.empty() ? "" : "`" + text + "`";
}

} // namespace squeal
