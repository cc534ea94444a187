#include "contact_work.hpp"

#include "squeal/base/broadcast.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace squeal
{

double largest_reaction(const std::vector<double>& r)
{
  double largest = 0;
  for (const double value : r) largest = std::max(largest, std::abs(value));
  return largest;
}

double defect_of(const ContactWork& work, std::size_t pair, const PairVector& w, double largest)
{
  const double defect = natural_map(work.reaction(pair), w, work.friction.of(pair), work.W.scale(pair));
  if (!std::isfinite(defect + w[0] + w[1] + w[2])) return std::numeric_limits<double>::infinity();
  return defect > 0 ? defect / work.scale_of(pair, largest) : 0;
}

double residual_of(const ContactWork& work)
{
  const double largest = largest_reaction(work.r);
  double residual = 0;
  for (std::size_t pair = 0; pair < work.W.pairs(); ++pair)
    residual = std::max(residual, defect_of(work, pair, work.velocity(pair), largest));
  return residual;
}

void form_products(std::span<ContactWork* const> works)
{
  if (works.empty()) return;
  std::vector<std::span<const double>> r;
  std::vector<std::span<double>> Wr;
  for (ContactWork* work : works)
  {
    work->Wr.resize(work->r.size());
    r.emplace_back(work->r);
    Wr.emplace_back(work->Wr);
    ++work->reads;
  }
  works.front()->W.multiply(r, Wr);
}

PairFriction announced_friction(PairFriction friction, MPI_Comm comm)
{
  MPI_Bcast(&friction.common, sizeof friction.common, MPI_BYTE, 0, comm);
  broadcast(friction.own, comm);
  broadcast(friction.number_of_own, comm);
  return friction;
}

} // namespace squeal
