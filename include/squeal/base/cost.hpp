#pragma once
/// Counted work, by which the program chooses between ways to one result: numbers of matrices that steps read. Ratios
/// are fixed and no clock is read, so that equal runs choose alike.

namespace squeal
{

/// What a question beside the main one may take.
inline constexpr double affordable_work = 2e9;

/// What the search for a motion may take.
inline constexpr double work_of_search = 2e10;

/// What a settled motion may take.
inline constexpr double work_of_settling = 1e11;

/// Of columns of the tangent along a period that takes `of_period`: they solve no contact, and share their reading.
constexpr double work_of_columns(double columns, double of_period)
{
  return columns * of_period / 4;
}

} // namespace squeal
