// The compliance of active pairs that a reduced model with fewer attachment shapes is said to lose, and its steps.
// ranks: 1 2 3
#include "../support/approx.hpp"
#include "../support/linearised.hpp"
#include "../support/pressed_masses.hpp"
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

} // namespace

namespace
{

/// The pressed masses on all attachments, or on the leading ones.
struct Reduced
{
  SmallModel model = pressed_masses();
  Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
  Modes modes;

  Reduced()
  {
    ModesSettings settings;
    settings.method = ModesMethod::full;
    modes = modes_of(model, equilibrium, settings, {});
    REQUIRE(!modes.modes.empty());
  }

  ReducedModel on_attachments(PetscInt count) const
  {
    std::vector<int> active(pressed_pairs);
    std::iota(active.begin(), active.end(), 0);
    Reduction reduction;
    reduction.modes = 1;
    reduction.attachments = count;
    return reduce({model.structure, model.interface, equilibrium}, modes.modes, active, reduction);
  }
};

} // namespace

TEST_CASE("what the leading attachments leave out is what their model lacks of the pairs' compliance")
{
  const Reduced brake;
  const ReducedModel whole = brake.on_attachments(all_attachments);
  CHECK(whole.left_out == 0);
  CHECK(whole.lost_compliance == 0);
  const Eigen::VectorXd exact = own_compliance(whole); // Ritz vectors that hold the response to each force
  double before = 1;
  for (int count = 1; count < whole.attachments; ++count)
  {
    const ReducedModel some = brake.on_attachments(count);
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
  const ReducedModel fitting = brake.on_attachments(0); // a small model fits any memory
  CHECK(fitting.left_out == 0);
}

TEST_CASE("ranks that share the products of a reduced model's steps take the same steps")
{
  const Reduced brake;
  const ReducedModel model = brake.on_attachments(all_attachments);
  constexpr int steps = 64;
  ReducedMap alone{model, steps}, shared{model, steps};
  alone.reactions = Eigen::VectorXd::Map(model.reactions.data(), static_cast<Eigen::Index>(model.reactions.size()));
  shared.reactions = alone.reactions;
  shared.shared_by = PETSC_COMM_WORLD;
  alone.contact.tolerance = shared.contact.tolerance = 1e-13;
  ReducedState start{Eigen::VectorXd::Zero(model.size()), Eigen::VectorXd::Zero(model.size())};
  start.v = model.M_factor.solve(model.G.transpose() * Eigen::VectorXd::LinSpaced(model.G.rows(), 0, 3));
  int open = 0;
  const double period = 4;
  const ReducedState by_each = integrate(alone, period, start, {});
  const ReducedState together =
      integrate(shared, period, start, [&](const ReducedState& now) { open += (model.G * now.q)(0) > 0; });
  CHECK(open > 0);     // pairs lift off on the way
  CHECK(open < steps); // and come back
  const double size = by_each.q.norm() + by_each.v.norm();
  // contact is solved to 1e-13 of the largest reaction, and pairs that close multiply what is left (measured 5e-10)
  CHECK((by_each.q - together.q).norm() + (by_each.v - together.v).norm() < 1e-8 * size);
  CHECK(alone.unconverged == 0);
  CHECK(shared.unconverged == 0);
}
