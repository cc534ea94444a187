#include "contact_work.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace squeal
{

Scales largest_reactions(const ContactWork& work)
{
  return largest_of_contacts(work.friction.contact, work.W.pairs(),
                             [&](std::size_t pair)
                             {
                               const PairVector r = work.reaction(pair);
                               return std::max({std::abs(r[0]), std::abs(r[1]), std::abs(r[2])});
                             });
}

double defect_of(const ContactWork& work, std::size_t pair, const PairVector& w, const Scales& largest)
{
  const double defect = natural_map(work.reaction(pair), w, work.friction.of(pair), work.W.scale(pair));
  if (!std::isfinite(defect + w[0] + w[1] + w[2])) return std::numeric_limits<double>::infinity();
  return defect > 0 ? defect / work.scale_of(pair, largest) : 0;
}

double residual_of(const ContactWork& work)
{
  const Scales largest = largest_reactions(work);
  double residual = 0;
  for (std::size_t pair = 0; pair < work.W.pairs(); ++pair)
    residual = std::max(residual, defect_of(work, pair, work.velocity(pair), largest));
  return residual;
}

void form_product(ContactWork& work)
{
  work.Wr.resize(work.r.size());
  ++work.reads;
  work.W.multiply(work.r, work.Wr);
}

} // namespace squeal
