#pragma once
/// Counted work, by which the program chooses between ways to one result: numbers of matrices that steps read. Ratios
/// are fixed and no clock is read, so that equal runs choose alike.
#include <cmath>

namespace squeal
{

/// Work that a question beside the main one may take.
inline constexpr double affordable_work = 2e9;

/// Periods that a search takes, or so.
inline constexpr double periods_of_search = 25;

/// Columns of the tangent that take as much as a period: they solve no contact, and share their reading. Columns that a
/// projection and the search beside it take.
inline constexpr double columns_per_period = 4, columns_of_projection = 200;

/// Entries that sweeps read from a core's cache for nothing; entries read, or pairs swept over, while ranks exchange
/// messages.
inline constexpr double entries_in_cache = 62500, entries_per_exchange = 1e6, pairs_per_exchange = 500;

/// Rows of a quadratic problem that LAPACK solves whole: 2.5 reads times the cube of twice the rows are affordable.
inline constexpr int rows_solved_whole = 400;

/// Whether the solutions of all sets of closed pairs take no more than a hundredth of what is affordable.
inline bool all_sets_are_cheap(double pairs)
{
  return std::exp2(pairs) * pairs * pairs * pairs <= affordable_work / 100;
}

/// Whether periods of this work are dear: a search takes more than is affordable. Factors, passes of contact, columns
/// and free periods are then spared.
constexpr bool is_dear(double of_period)
{
  return periods_of_search * of_period > affordable_work;
}

/// Whether the whole tangent of a state with so many entries takes no more columns than a search takes work.
constexpr bool whole_tangent_is_cheap(double entries)
{
  return entries <= columns_per_period * periods_of_search;
}

} // namespace squeal
