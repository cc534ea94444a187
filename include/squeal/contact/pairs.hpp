#pragma once
/// Entries of contact vectors by pairs. A contact vector (reactions, gaps with slidings, velocities) has an entry for
/// every row of B (src/README.md, section 1.2). Of each pair these are its normal row and its `directions` tangential
/// ones. Only this header knows that order. How many nodes a pair reads is a matter of its rows of B alone. Views
/// borrow their numbers and check no sizes.
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>

namespace squeal
{

/// n, t1, t2 of one pair; t2 stays 0 where pairs have one tangential row, both tangential entries where they have none.
using PairVector = std::array<double, 3>;
using PairBlock = std::array<PairVector, 3>;

/// Numbers of the rows of B that belong to a pair. Index: of the container that is read, PETSc's or Eigen's say.
template <class Index> struct PairRows
{
  Index directions; // tangential rows of a pair

  explicit PairRows(int of_a_pair) : directions(static_cast<Index>(of_a_pair)) {}

  Index per_pair() const { return 1 + directions; }
  Index normal(Index pair) const { return pair * per_pair(); }
  Index tangential(Index pair) const { return normal(pair) + 1; } // the first one
  Index rows_of(Index pairs) const { return pairs * per_pair(); }
  Index tangential_rows_of(Index pairs) const { return pairs * directions; }
  Index pair_of(Index row) const { return row / per_pair(); }
  Index component_of(Index row) const { return row % per_pair(); } // 0: normal, then the tangential ones
  bool is_normal(Index row) const { return component_of(row) == 0; }
};

/// The number of tangential rows that each of `pairs` has where all have `rows`; none where pairs cannot have that
/// many.
template <class Index> std::optional<int> directions_of(Index rows, Index pairs)
{
  for (const int directions : {1, 2})
    if (rows == PairRows<Index>(directions).rows_of(pairs)) return directions;
  return {};
}

/// A contact vector read and written by pairs: a view of a std::vector, a span or an Eigen vector.
template <class Value> class PairView
{
public:
  template <class Container> PairView(Container& values, int directions)
      : values_(values.data(), static_cast<std::size_t>(values.size())), rows_(directions)
  {
  }

  std::size_t size() const { return values_.size(); }
  std::size_t pairs() const { return values_.size() / rows_.per_pair(); }
  int directions() const { return static_cast<int>(rows_.directions); }

  Value& normal(std::size_t pair) const { return values_[rows_.normal(pair)]; }
  std::span<Value> tangential(std::size_t pair) const
  {
    return values_.subspan(rows_.tangential(pair), rows_.directions);
  }
  std::span<Value> of(std::size_t pair) const { return values_.subspan(rows_.normal(pair), rows_.per_pair()); }

  PairVector vector(std::size_t pair) const
  {
    const Value* first = &values_[rows_.normal(pair)];
    return {first[0], rows_.directions > 0 ? first[1] : 0., rows_.directions > 1 ? first[2] : 0.};
  }

  void set(std::size_t pair, const PairVector& entries) const requires(!std::is_const_v<Value>)
  {
    Value* first = &values_[rows_.normal(pair)];
    first[0] = entries[0];
    if (rows_.directions > 0) first[1] = entries[1];
    if (rows_.directions > 1) first[2] = entries[2];
  }

  operator PairView<const Value>() const requires(!std::is_const_v<Value>)
  {
    return PairView<const Value>(values_, static_cast<int>(rows_.directions));
  }

private:
  std::span<Value> values_;
  PairRows<std::size_t> rows_;
};

template <class Container> PairView(Container&, int)
    -> PairView<std::remove_pointer_t<decltype(std::declval<Container&>().data())>>;

/// The tangential entries alone, `directions` a pair: drive velocities, directions of friction.
template <class Value> class TangentView
{
public:
  template <class Container> TangentView(Container& values, int directions)
      : values_(values.data(), static_cast<std::size_t>(values.size())),
        directions_(static_cast<std::size_t>(directions))
  {
  }

  std::span<Value> of(std::size_t pair) const { return values_.subspan(pair * directions_, directions_); }

private:
  std::span<Value> values_;
  std::size_t directions_;
};

template <class Container> TangentView(Container&, int)
    -> TangentView<std::remove_pointer_t<decltype(std::declval<Container&>().data())>>;

/// a . b over the entries of a.
inline double dot(std::span<const double> a, std::span<const double> b)
{
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += a[k] * b[k];
  return sum;
}

/// Length of a pair's tangential entries.
inline double length(std::span<const double> tangential)
{
  double size = 0;
  for (const double entry : tangential) size = std::hypot(size, entry);
  return size;
}

} // namespace squeal
