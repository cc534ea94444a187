// ranks: 1
#include "../../src/contact/near_field.hpp"
#include "../support/contact_problem.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>
#include <limits>
#include <random>

using namespace squeal;
using test::contact_residual;
using test::solve_contact;

namespace
{

using Vector = std::vector<double>;

constexpr int pairs = 121; // no multiple of what is taken at once
constexpr std::size_t size = 3 * pairs;

/// Decays with distance like the W of a short step, down to a tail. The near field leaves all beyond three neighbours
/// out, 6e-3 of the diagonal: far above the tolerance of 1e-10.
Vector decaying_compliance()
{
  Vector W(size * size);
  for (std::size_t i = 0; i < size; ++i)
    for (std::size_t j = 0; j < size; ++j)
    {
      const double distance = std::abs(static_cast<double>(i / 3) - static_cast<double>(j / 3));
      const double along = i % 3 == j % 3 ? 1 : 0.2;
      W[i * size + j] = along * std::exp(-1.5 * distance) + 4e-9 * std::cos(static_cast<double>(i % 7 + j % 7));
    }
  return W;
}

Vector velocity_at(double time)
{
  Vector b(size);
  for (std::size_t i = 0; i < size; ++i)
  {
    const double phase = 0.7 * static_cast<double>(i);
    b[i] = i % 3 == 0 ? -0.5 + std::cos(phase + time) : 2 * std::sin(0.3 * phase + 2 * time);
  }
  return b;
}

double difference(const Vector& a, const Vector& b)
{
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

double true_residual(const Vector& W, const Vector& b, const Vector& r)
{
  return contact_residual(make_contact_operator(W, pairs, 2), FrictionLaw{0.4}, b, r);
}

} // namespace

TEST_CASE("sweeps over the near field in single precision end at the answer of W in double")
{
  const Vector W = decaying_compliance(), b = velocity_at(0);
  const ContactOperator op = make_contact_operator(W, pairs, 2);
  std::size_t near = 0;
  for (const NearRow& row : make_near_field({0, size, size, W.data()}, pairs, 2, PETSC_COMM_SELF).rows)
    near += row.values.size();
  CHECK(near < 0.1 * size * size); // 7 of 121 blocks
  CHECK(op.has_near_field());
  Vector swept, projected;
  const auto result = solve_contact(op, b, {0.4}, {}, swept);
  CHECK(result.converged);
  CHECK(true_residual(W, b, swept) < 1.01e-10); // another order of summation
  CHECK(solve_contact(op, b, {0.4}, {ContactSolver::fixed_point, 1e-12, 20000, 0}, projected).converged);
  CHECK(difference(swept, projected) < 1e-8 * *std::max_element(projected.begin(), projected.end())); // cond(W) < 100
  CHECK(std::count_if(swept.begin(), swept.end(), [](double r) { return r == 0; }) > 30); // some pairs are open

  Vector without_tail = W;
  for (double& entry : without_tail)
    if (std::abs(entry) < 1e-8) entry = 0;
  Vector other;
  CHECK(solve_contact(make_contact_operator(without_tail, pairs, 2), b, {0.4}, {}, other).converged);
  CHECK(true_residual(W, b, other) > 1e-8); // the tail counts
}

TEST_CASE("what is remembered changes no answer")
{
  const Vector W = decaying_compliance();
  const ContactOperator op = make_contact_operator(W, pairs, 2);
  Vector r;
  ContactMemory memory;
  std::vector<int> sweeps;
  for (int step = 0; step < 8; ++step)
  {
    const Vector b = velocity_at(0.02 * step);
    const ContactResult result = squeal::solve_contact(op, FrictionLaw{0.4}, {}, {b, r, memory});
    CHECK(result.converged);
    CHECK(true_residual(W, b, r) < 1.01e-10);
    Vector alone;
    CHECK(solve_contact(op, b, {0.4}, {}, alone).converged);
    CHECK(difference(r, alone) < 1e-8);
    sweeps.push_back(result.iterations);
  }
  CHECK(sweeps.back() < sweeps.front()); // the extrapolated start is nearer
}
