// The compliance of active pairs that a reduced model with fewer attachment shapes is said to lose.
// ranks: 1 2 3
#include "../support/approx.hpp"
#include "../support/linearised.hpp"
#include "../support/pressed_masses.hpp"
#include "squeal/reduction/reduced_model.hpp"

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

} // namespace

TEST_CASE("what the leading attachments leave out is what their model lacks of the pairs' compliance")
{
  const SmallModel model = pressed_masses();
  const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
  ModesSettings settings;
  settings.method = ModesMethod::full;
  const Modes modes = modes_of(model, equilibrium, settings, {});
  REQUIRE(!modes.modes.empty());
  std::vector<int> active(pressed_pairs);
  std::iota(active.begin(), active.end(), 0);
  const auto reduced = [&](PetscInt attachments)
  {
    Reduction reduction;
    reduction.modes = 1;
    reduction.attachments = attachments;
    return reduce({model.structure, model.interface, equilibrium}, modes.modes, active, reduction);
  };
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
  const ReducedModel fitting = reduced(0); // a small model fits any memory
  CHECK(fitting.left_out == 0);
}
