#include "contact_work.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/checkpoint.hpp"

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

namespace
{

void describe(Checkpoint& checkpoint, FrictionLaw& law)
{
  describe_all(checkpoint, law.coefficient, law.static_coefficient, law.decay_speed, law.factor_at_speed.at,
               law.factor_at_speed.value);
}

/// The laws as numbers, without those of each pair.
void describe_laws(Checkpoint& checkpoint, PairFriction& friction)
{
  std::size_t own = friction.own.size();
  checkpoint.pass_size(own);
  friction.own.resize(own);
  describe(checkpoint, friction.common);
  for (FrictionLaw& law : friction.own) describe(checkpoint, law);
}

} // namespace

PairFriction announced_friction(PairFriction friction, MPI_Comm comm)
{
  Checkpoint written;
  describe_laws(written, friction);
  std::vector<double> numbers = written.numbers();
  broadcast(numbers, comm);
  Checkpoint read(std::move(numbers));
  describe_laws(read, friction);
  broadcast(friction.number_of_own, comm);
  broadcast(friction.contact, comm);
  return friction;
}

} // namespace squeal
