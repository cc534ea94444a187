#pragma once
/// Work at the end of a scope.
#include <functional>

namespace squeal
{

/// Does its work at the end of its life.
struct [[nodiscard]] Finally
{
  explicit Finally(std::function<void()> end) : work(std::move(end)) {}
  Finally(const Finally&) = delete;
  Finally& operator=(const Finally&) = delete;
  ~Finally() { work(); }

  std::function<void()> work;
};

} // namespace squeal
