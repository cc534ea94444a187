#include "squeal/contact/sliding_direction.hpp"

namespace squeal
{

std::vector<double> past_sliding(PairView<const double> velocity, TangentView<const double> drive,
                                 const std::vector<ContactStatus>& status, double weight)
{
  std::vector<double> result(velocity.size(), 0.);
  const PairView past(result, velocity.directions());
  for (std::size_t i = 0; i < status.size(); ++i)
    for (std::size_t k = 0; status[i] != ContactStatus::stick && k < past.tangential(i).size(); ++k)
      past.tangential(i)[k] = weight * (velocity.tangential(i)[k] - drive.of(i)[k]);
  return result;
}

bool leave_out_where_turned(PairView<const double> r, PairView<const double> w, PairView<double> past)
{
  bool any = false;
  for (std::size_t i = 0; i < r.pairs(); ++i)
  {
    const std::span<double> before = past.tangential(i);
    if (r.normal(i) <= 0 || dot(w.tangential(i), before) >= dot(before, before)) continue;
    std::fill(before.begin(), before.end(), 0.);
    any = true;
  }
  return any;
}

bool opposes_end(PairView<const double> past, std::size_t pair)
{
  const std::span<const double> before = past.tangential(pair);
  return std::all_of(before.begin(), before.end(), [](double component) { return component == 0; });
}

} // namespace squeal
