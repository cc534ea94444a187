// The compliance of active pairs that a reduced model with fewer attachment shapes is said to lose, and its motion and
// tangent by one rank and by all together.
// ranks: 1 2 3
#include "../support/approx.hpp"
#include "../support/linearised.hpp"
#include "../support/pressed_masses.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/reduction/reduced_step.hpp"

#include <doctest/doctest.h>
#include <numeric>

using namespace squeal;
using namespace squeal::test;

namespace
{

/// The pairs' normal rows.
Eigen::VectorXd normal_rows(const Eigen::VectorXd& of_rows)
{
  const PairRows<Eigen::Index> rows(1);
  Eigen::VectorXd normal(pressed_pairs);
  for (Eigen::Index i = 0; i < normal.size(); ++i) normal(i) = of_rows(rows.normal(i));
  return normal;
}

/// Of each row of the pairs: how far a unit force moves it.
Eigen::VectorXd own_compliance(const ReducedModel& model)
{
  return (model.G * model.E_factor.solve(model.G.transpose())).diagonal();
}

/// The brake of pressed masses reduced on all its pairs.
struct ReducedMasses
{
  SmallModel masses = pressed_masses();
  Equilibrium equilibrium = find_equilibrium(masses.structure, masses.interface, {});
  Modes modes = full_modes();

  Modes full_modes() const
  {
    ModesSettings settings;
    return modes_of(masses, equilibrium, settings, {});
  }

  ReducedModel on(PetscInt attachments) const
  {
    std::vector<int> active(pressed_pairs);
    std::iota(active.begin(), active.end(), 0);
    Reduction reduction;
    reduction.modes = 1;
    reduction.attachments = attachments;
    return reduce({masses.structure, masses.interface, equilibrium}, modes.modes, active, reduction);
  }
};

/// A period of a motion in which pairs part, by the ranks of `comm` together.
struct Period
{
  PeriodEnd end;
  std::vector<StepRecord> contacts;
  Eigen::MatrixXd monodromy, adjoint; // dPhi/dx in the slow coordinates, and its transpose times that
};

Period period_by(MPI_Comm comm, const ReducedModel& model)
{
  ReducedMap map{model, 16, 0.5, comm};
  map.reactions = Eigen::VectorXd::Map(model.reactions.data(), static_cast<Eigen::Index>(model.reactions.size()));
  map.contact.tolerance = 1e-12;
  const ReducedState start{Eigen::VectorXd::Zero(model.size()), Eigen::VectorXd::LinSpaced(model.size(), -3, 2)};
  const double length = two_pi / model.omega;
  Period period{end_of_period(map, length, start), record_contacts(map, length, start), {}, {}};
  CHECK(map.unconverged == 0);
  period.monodromy = monodromy(map, length, period.contacts);
  period.adjoint = apply_adjoint(map, length, period.contacts, period.monodromy);
  return period;
}

/// Largest distance to what the first rank has.
double distance_to_first_rank(const Eigen::VectorXd& x)
{
  Eigen::VectorXd first = x;
  broadcast(first, PETSC_COMM_WORLD);
  return (x - first).cwiseAbs().maxCoeff();
}

} // namespace

TEST_CASE("what the leading attachments leave out is what their model lacks of the pairs' compliance")
{
  const ReducedMasses masses;
  REQUIRE(!masses.modes.modes.empty());
  const auto reduced = [&](PetscInt attachments) { return masses.on(attachments); };
  const ReducedModel whole = reduced(all_attachments);
  CHECK(whole.left_out == 0);
  CHECK(whole.lost_compliance == 0);
  const Eigen::VectorXd exact = own_compliance(whole); // Ritz vectors that hold the response to each force
  double before = 1;
  for (int count = 1; count < whole.attachments; ++count)
  {
    const ReducedModel some = reduced(count);
    CHECK(some.attachments == count);
    CHECK(some.left_out == whole.attachments - count);
    const double lost = 1 - own_compliance(some).cwiseQuotient(exact).mean();
    CHECK(some.lost_compliance == approx(lost, 1e-9)); // 1 less a mean near 1: rounding over the smallest part lost
    CHECK(some.lost_compliance < before);
    before = some.lost_compliance;
    // what the shapes and those left out have of a pair's own compliance is all of it
    const Eigen::VectorXd normal = normal_rows(own_compliance(some)) + some.of_left_out;
    CHECK((normal - normal_rows(exact)).cwiseAbs().maxCoeff() <= 1e-9 * exact.maxCoeff());
  }
}

TEST_CASE("ranks that follow a motion of the reduced model together find what one rank does")
{
  const ReducedModel model = ReducedMasses().on(all_attachments);
  const Period alone = period_by(PETSC_COMM_SELF, model), together = period_by(PETSC_COMM_WORLD, model);
  bool parts = false;
  for (const StepRecord& contact : alone.contacts)
    for (int pair = 0; pair < pressed_pairs; ++pair)
      parts = parts || PairView(contact.reactions, model.directions).normal(static_cast<std::size_t>(pair)) == 0;
  CHECK(parts);
  // What a change of the reactions does is computed in single precision, 6e-8, in each of the 16 steps.
  const auto near = [](const auto& one, const auto& other)
  { return (one - other).cwiseAbs().maxCoeff() <= 1e-6 * one.cwiseAbs().maxCoeff(); };
  CHECK(near(alone.end.end.q, together.end.end.q));
  CHECK(near(alone.end.end.v, together.end.end.v));
  CHECK(near(alone.end.rate.v, together.end.rate.v));
  CHECK(near(alone.monodromy, together.monodromy));
  CHECK(near(alone.adjoint, together.adjoint));
  // the adjoint is the transpose: Phi'M, M = Phi S, has M'M in the rows of S
  const Eigen::Index size = model.size(), slow = model.slow;
  Eigen::MatrixXd seen(2 * slow, alone.adjoint.cols());
  seen << alone.adjoint.topRows(slow), alone.adjoint.middleRows(size, slow);
  CHECK(near(Eigen::MatrixXd(alone.monodromy.transpose() * alone.monodromy), seen));
  // What all ranks decide on has the same bits.
  CHECK(distance_to_first_rank(together.end.end.v) == 0);
  CHECK(distance_to_first_rank(together.end.rate.q) == 0);
}
