// The tangent of recorded steps against central differences of the steps themselves. Differences of 1e-6 of the motion
// have an error of 1e-7 by contact solved to 1e-13, and less by curvature: 1e-6 of the change is asked.
#include "../support/oscillator_mode.hpp"
#include "squeal/transient/theta_step.hpp"

#include <doctest/doctest.h>
#include <random>

using namespace squeal;
using test::Rows;
using test::SmallModel;

namespace
{

constexpr double difference = 1e-6, tolerance = 1e-6;

/// Symmetric, positive definite.
Rows random_stiffness(std::mt19937& random, std::size_t n)
{
  std::uniform_real_distribution<double> uniform(-0.3, 0.3);
  Rows K = test::diagonal(std::vector<double>(n, 1.));
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < i; ++j) K[i][j] = K[j][i] = uniform(random);
  for (std::size_t i = 0; i < n; ++i) K[i][i] += 0.5 + uniform(random);
  return K;
}

/// Two masses that move in space, each pressed on a belt; the second is pressed less and driven across.
SmallModel two_masses(std::mt19937& random, int directions, double friction)
{
  SmallModel model;
  const Rows K = random_stiffness(random, 6);
  Rows C = K;
  for (auto& row : C)
    for (double& entry : row) entry *= 0.02;
  model.structure = test::make_structure(test::diagonal({1, 1.2, 0.8, 0.6, 1, 1.1}), C, K, {0, 0, -1, 0, 0, -0.6});
  Rows B = test::zeros(0, 0);
  std::vector<double> drive;
  for (std::size_t mass = 0; mass < 2; ++mass)
    for (int row = 0; row <= directions; ++row)
    {
      std::vector<double> entries(6, 0.);
      entries[3 * mass + (row == 0 ? 2 : static_cast<std::size_t>(row) - 1)] = 1;
      B.push_back(entries);
      if (row > 0) drive.push_back((row == 1) == (mass == 0) ? 0.3 : 0.05);
    }
  model.interface = test::make_interface(B, directions, {0, 0.1}, drive, friction, model.structure.K);
  return model;
}

struct Run
{
  State end;
  std::vector<StepRecord> records;
  std::vector<std::vector<ContactStatus>> statuses; // [step][pair]
};

State random_state(const SmallModel& model, std::mt19937& random, double size)
{
  std::normal_distribution<double> normal(0, size);
  PetscInt dofs = 0;
  check(VecGetSize(model.structure.load, &dofs));
  std::vector<double> u(static_cast<std::size_t>(dofs)), v(u);
  for (double& entry : u) entry = normal(random);
  for (double& entry : v) entry = normal(random);
  return test::state_of(model.structure, u, v);
}

Run run(const SmallModel& model, const State& start, double h, double theta, int steps)
{
  StepOptions options;
  options.contact.tolerance = 1e-13;
  const ThetaStep step = make_theta_step(model.structure, model.interface, h, theta, options);
  Run result{copy_of(start), {}, {}};
  result.records.resize(static_cast<std::size_t>(steps));
  take_steps(step, model.structure, model.interface, result.end, steps, {result.records});
  for (const StepRecord& record : result.records)
    result.statuses.push_back(contact_status(model.interface, record.reactions, record.contact_velocity));
  return result;
}

bool same_branch(const Run& a, const Run& b)
{
  if (a.statuses != b.statuses) return false;
  for (std::size_t i = 0; i < a.records.size(); ++i)
    if (a.records[i].opposes_theta != b.records[i].opposes_theta) return false;
  return true;
}

/// Which kinds of pairs the comparisons have met.
struct Met
{
  int open = 0, stick = 0, slip = 0, turned = 0, compared = 0;
};

void count(const Run& run, Met& met)
{
  ++met.compared;
  for (std::size_t step = 0; step < run.records.size(); ++step)
    for (std::size_t pair = 0; pair < run.statuses[step].size(); ++pair)
    {
      const ContactStatus status = run.statuses[step][pair];
      ++(status == ContactStatus::open ? met.open : status == ContactStatus::stick ? met.stick : met.slip);
      met.turned += status == ContactStatus::slip && !run.records[step].opposes_theta[pair];
    }
}

std::vector<double> entries_of(Vec u, Vec v)
{
  std::vector<double> all = all_entries(u);
  const std::vector<double> rest = all_entries(v);
  all.insert(all.end(), rest.begin(), rest.end());
  return all;
}

/// |(plus - minus)/(2 difference) - tangent| over |tangent|; the state is of size 1.
double relative_error(const Run& plus, const Run& minus, const TangentColumn& column)
{
  const std::vector<double> a = entries_of(plus.end.u, plus.end.v), b = entries_of(minus.end.u, minus.end.v),
                            exact = entries_of(column.u, column.v);
  double error = 0, size = 0.1;
  for (std::size_t i = 0; i < a.size(); ++i)
  {
    error = std::max(error, std::abs((a[i] - b[i]) / (2 * difference) - exact[i]));
    size = std::max(size, std::abs(exact[i]));
  }
  return error / size;
}

/// The column of a change of the state, where all the motions compared have the same statuses.
void compare(SmallModel& model, std::mt19937& random, double theta, int steps, Met& met)
{
  const double h = 0.15;
  const State start = random_state(model, random, 0.4), direction = random_state(model, random, 1);
  const Run middle = run(model, start, h, theta, steps);
  std::array<Run, 2> moved;
  for (int sign = 0; sign < 2; ++sign)
  {
    const double change = sign == 0 ? difference : -difference;
    State other = copy_of(start);
    check(VecAXPY(other.u, change, direction.u));
    check(VecAXPY(other.v, change, direction.v));
    moved[static_cast<std::size_t>(sign)] = run(model, other, h, theta, steps);
  }
  for (const Run& other : moved)
    if (!same_branch(middle, other)) return;
  count(middle, met);
  const ThetaStep step = make_theta_step(model.structure, model.interface, h, theta, {});
  TangentColumn column{copy_of(direction.u.get()), copy_of(direction.v.get())};
  advance_tangents(step, model.structure, model.interface, middle.records, std::span(&column, 1));
  CHECK(relative_error(moved[0], moved[1], column) < tolerance);
}

} // namespace

TEST_CASE("the tangent of recorded steps is that of central differences")
{
  for (const int directions : {1, 2})
    for (const double theta : {0.5, 0.7})
    {
      CAPTURE(directions);
      CAPTURE(theta);
      std::mt19937 random(7);
      Met met;
      for (int sample = 0; sample < 40; ++sample)
      {
        SmallModel model = two_masses(random, directions, 0.6);
        compare(model, random, theta, 12, met);
        if (sample % 2 == 0) continue;
        model.interface.friction = FrictionLaw{0.4, true, 0.7, 0.8};
        compare(model, random, theta, 12, met);
      }
      CHECK(met.compared > 20);
      CHECK(met.open > 20);
      CHECK(met.stick > 20);
      CHECK(met.slip > 20);
      CHECK(met.turned > 2);
    }
}

TEST_CASE("the unilateral oscillator's period has the tangent of central differences")
{
  std::mt19937 random(3);
  Met met;
  for (int sample = 0; sample < 20; ++sample)
  {
    SmallModel model = test::unilateral_oscillator(0.3, 0.6);
    compare(model, random, 0.5, 42, met);
  }
  CHECK(met.compared > 5);
}

TEST_CASE("proportional damping spares products with K and leaves the tangent as it is")
{
  // 200 steps take K du from differences and multiply it anew, twice; a dashpot that is no sum of M and K has all
  // products made, and changes the tangent itself by its size
  constexpr double dashpot = 1e-9;
  std::mt19937 random(11);
  for (const int directions : {1, 2})
    for (const double theta : {0.5, 0.7})
    {
      CAPTURE(directions);
      CAPTURE(theta);
      SmallModel model = two_masses(random, directions, 0.6);
      Mat C = model.structure.C;
      check(MatCopy(model.structure.M, C, SAME_NONZERO_PATTERN));
      check(MatScale(C, 0.02));
      check(MatAXPY(C, 0.03, model.structure.K, SAME_NONZERO_PATTERN));
      const State start = random_state(model, random, 0.4), direction = random_state(model, random, 1);
      const Run middle = run(model, start, 0.15, theta, 200);
      std::array<TangentColumn, 2> columns;
      for (TangentColumn& column : columns)
      {
        column = {copy_of(direction.u.get()), copy_of(direction.v.get())};
        const ThetaStep step = make_theta_step(model.structure, model.interface, 0.15, theta, {});
        advance_tangents(step, model.structure, model.interface, middle.records, std::span(&column, 1));
        PetscInt first = 0, last = 0;
        check(MatGetOwnershipRange(C, &first, &last));
        if (first == 0 && last > 0) check(MatSetValue(C, 0, 0, dashpot, ADD_VALUES));
        check(MatAssemblyBegin(C, MAT_FINAL_ASSEMBLY));
        check(MatAssemblyEnd(C, MAT_FINAL_ASSEMBLY));
      }
      const auto by_mass = entries_of(columns[0].u, columns[0].v), by_both = entries_of(columns[1].u, columns[1].v);
      double error = 0, size = 1;
      for (std::size_t i = 0; i < by_mass.size(); ++i)
      {
        error = std::max(error, std::abs(by_mass[i] - by_both[i]));
        size = std::max(size, std::abs(by_both[i]));
      }
      CHECK(error <= 30 * dashpot * size); // of 30 units of time
      CHECK(error > 0);
    }
}
