#pragma once
/// Contact problems of the tests: random numbers, differences, and the solution without a warm start.
#include "squeal/contact/solver.hpp"

#include <algorithm>
#include <cmath>
#include <random>

namespace squeal::test
{

/// From -1 to 1.
inline double uniform(std::mt19937& random)
{
  return std::uniform_real_distribution<double>(-1, 1)(random);
}

/// The largest |a_i - b_i|.
inline double difference(const std::vector<double>& a, const std::vector<double>& b)
{
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

inline ContactResult solve_contact(const ContactOperator& W, const std::vector<double>& b, const FrictionLaw& friction,
                                   const ContactSettings& settings, std::vector<double>& r)
{
  ContactMemory nothing;
  return squeal::solve_contact(W, friction, settings, {b, r, nothing});
}

/// The residual of reactions r: of a solution by no iteration. On the ranks that have W.
inline double contact_residual(const ContactOperator& W, const PairFriction& friction, const std::vector<double>& b,
                               std::vector<double> r)
{
  ContactMemory nothing;
  return squeal::solve_contact(W, friction, {.solver = ContactSolver::fixed_point, .max_iterations = 0},
                               {b, r, nothing})
      .residual;
}

} // namespace squeal::test
