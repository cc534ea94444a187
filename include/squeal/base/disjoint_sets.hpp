#pragma once
/// Numbers 0, 1, ... in disjoint sets that are joined two by two, by union-find with path halving (Tarjan and van
/// Leeuwen 1984).
#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace squeal
{

class DisjointSets
{
public:
  /// Each number alone.
  explicit DisjointSets(std::size_t count) : above_(count) { std::iota(above_.begin(), above_.end(), 0); }

  int size() const { return static_cast<int>(above_.size()); }

  /// The least number of the set, the same for all of them.
  int least(int number)
  {
    while (above(number) != number) number = above(number) = above(above(number));
    return number;
  }

  void join(int a, int b)
  {
    const int x = least(a), y = least(b);
    above(std::max(x, y)) = std::min(x, y);
  }

private:
  int& above(int number) { return above_[static_cast<std::size_t>(number)]; }

  std::vector<int> above_; // a lower number of the same set, or the number itself
};

} // namespace squeal
