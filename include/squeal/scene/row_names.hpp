#pragma once
/// How a matrix scene names degrees of freedom: by the rows of its matrices, or by the nodes of the code they are from.
#include <optional>
#include <string>
#include <vector>

namespace squeal
{

/// "dof:7" is a row of the matrices, "node:1017" all rows of a node; lists and ranges are "node:3,8,20-40".
struct RowNames
{
  struct Range
  {
    long first = 0, last = 0;
  };
  bool nodes = false; // nodes, not rows
  std::vector<Range> ranges;

  bool is_single() const { return ranges.size() == 1 && ranges[0].first == ranges[0].last; }
};

/// Returns what the text names; nothing if it is of another form.
std::optional<RowNames> row_names(const std::string& text);

} // namespace squeal
