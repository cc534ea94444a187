// The compliance of active pairs that a reduced model with fewer attachment shapes is said to lose.
// ranks: 1 2 3
#include "../support/approx.hpp"
#include "../support/linearised.hpp"
#include "../support/small_models.hpp"
#include "squeal/reduction/reduced_model.hpp"

#include <doctest/doctest.h>
#include <numeric>
#include <random>

using namespace squeal;
using namespace squeal::test;

namespace
{

constexpr int pairs = 6;

/// Masses of two motions each on random springs to each other, all of them pressed onto a belt, pair i along motion
/// 2 i + 1 and rubbing along 2 i; three more hold nothing.
SmallModel pressed_masses()
{
  constexpr std::size_t n = 2 * pairs + 3;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> spring(0.1, 1);
  Rows K = zeros(n, n), B = zeros(2 * pairs, n);
  std::vector<double> load(n, 0);
  for (std::size_t i = 0; i < n; ++i)
  {
    K[i][i] += spring(random);
    for (std::size_t j = 0; j < i; ++j)
    {
      const double k = spring(random);
      K[i][i] += k;
      K[j][j] += k;
      K[i][j] = K[j][i] = -k;
    }
  }
  for (std::size_t i = 0; i < pairs; ++i)
  {
    B[2 * i][2 * i + 1] = B[2 * i + 1][2 * i] = 1;
    load[2 * i + 1] = -1;
  }
  SmallModel model;
  model.structure =
      make_structure(diagonal(std::vector<double>(n, 1)), diagonal(std::vector<double>(n, 0.01)), K, load);
  model.interface =
      make_interface(B, 1, std::vector<double>(pairs, 0), std::vector<double>(pairs, 1), 0.1, model.structure.K);
  return model;
}

/// The pairs' normal rows.
Eigen::VectorXd normal_rows(const Eigen::VectorXd& of_rows)
{
  const PairRows<Eigen::Index> rows(1);
  Eigen::VectorXd normal(pairs);
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
  std::vector<int> active(pairs);
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
