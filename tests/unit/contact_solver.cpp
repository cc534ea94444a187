#include "../support/contact_problem.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <doctest/doctest.h>
#include <random>

using namespace squeal;
using test::contact_residual;
using test::difference;
using test::solve_contact;
using test::uniform;

namespace
{

using Vector = std::vector<double>;

/// H H' plus a share of the identity: symmetric positive definite, worse conditioned as the share falls.
Vector random_spd(std::size_t n, double share, std::mt19937& random)
{
  Vector H(n * n), W(n * n, 0.);
  for (double& value : H) value = uniform(random);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
    {
      for (std::size_t k = 0; k < n; ++k) W[i * n + j] += H[i * n + k] * H[j * n + k] / static_cast<double>(n);
      if (i == j) W[i * n + j] += share;
    }
  return W;
}

Vector random_velocity(std::size_t n, std::mt19937& random)
{
  Vector b(n);
  for (double& value : b) value = uniform(random);
  return b;
}

/// Signorini and Coulomb, said without projections: forces, velocities and powers that the laws are missed by.
double law_defect(const PairVector& r, const PairVector& w, double mu)
{
  const double r_t = std::hypot(r[1], r[2]), w_t = std::hypot(w[1], w[2]);
  // maximal dissipation: r_t . w_t = -mu r_n |w_t|
  const double dissipation = std::abs(r[1] * w[1] + r[2] * w[2] + mu * r[0] * w_t);
  return std::max({0., -r[0], -w[0], r_t - mu * r[0], std::abs(r[0] * w[0]), dissipation});
}

} // namespace

TEST_CASE("one pair: the local solution obeys Signorini's and Coulomb's laws to round-off, at any friction")
{
  std::mt19937 random(3);
  int open = 0, stick = 0, slip = 0;
  for (int trial = 0; trial < 20000; ++trial)
  {
    const int directions = 1 + trial % 2;
    const double mu = trial % 3 == 0 ? 3 : 0.4;
    const std::size_t block = static_cast<std::size_t>(1 + directions);
    const Vector W = random_spd(block, trial % 5 == 0 ? 1e-3 : 0.3, random);
    PairBlock A{};
    PairVector q{}, last{};
    for (std::size_t i = 0; i < block; ++i)
    {
      q[i] = uniform(random);
      last[i] = trial % 4 == 0 ? 0 : uniform(random);
      for (std::size_t j = 0; j < block; ++j) A[i][j] = W[i * block + j];
    }
    const PairVector r = solve_pair(A, q, directions, {mu}, last);
    PairVector w = q;
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) w[i] += A[i][j] * r[j];
    // w is a difference of terms of the size of A r: the rounding of those is what the laws can be missed by
    const double force = 1 + std::abs(r[0]) + std::abs(r[1]) + std::abs(r[2]), rounding = 1e-12 * force * force;
    CHECK(law_defect(r, w, mu) < rounding);
    const double sliding = std::hypot(w[1], w[2]);
    (r[0] == 0 ? open : sliding > 1e-9 ? slip : stick) += 1;
  }
  CHECK(std::min({open, stick, slip}) > 1000); // every status was met
}

TEST_CASE(
    "one pair: where friction depends on the speed, the local solution has the law's coefficient at its own speed")
{
  std::mt19937 random(5);
  int stick = 0, slip = 0;
  for (int trial = 0; trial < 4000; ++trial)
  {
    const int directions = 1 + trial % 2;
    const FrictionLaw law = trial % 3 == 0 ? FrictionLaw{0.5, true, 0.3, 1} : FrictionLaw{0.3, true, 0.6, 1.5};
    const std::size_t block = static_cast<std::size_t>(1 + directions);
    const Vector W = random_spd(block, 0.3, random);
    PairBlock A{};
    PairVector q{-1, 0, 0}, last{};
    for (std::size_t i = 0; i < block; ++i)
    {
      if (i > 0) q[i] = uniform(random);
      last[i] = trial % 4 == 0 ? 0 : uniform(random);
      for (std::size_t j = 0; j < block; ++j) A[i][j] = W[i * block + j];
    }
    const PairVector r = solve_pair(A, q, directions, law, last), w = pair_velocity(A, r, q);
    const double sliding = std::hypot(w[1], w[2]), mu = friction_coefficient(law, sliding).value;
    if (steepest_fall(law) * r[0] * (A[1][1] + A[2][2]) >= 1) continue; // it may have several solutions
    CHECK(law_defect(r, w, mu) < 1e-11); // the speed is known to rounding, and mu with it
    CHECK(natural_map(r, w, law, natural_scale(A, 0)) < 1e-11);
    const ContactStatus status = contact_status(r, w, law, r[0]);
    CHECK((status == ContactStatus::stick) == (sliding < 1e-9));
    ++(status == ContactStatus::stick ? stick : slip);
  }
  CHECK(std::min(stick, slip) > 500);
}

TEST_CASE("Gauss-Seidel and the fixed point agree where friction depends on the speed")
{
  std::mt19937 random(19);
  for (const int directions : {1, 2})
  {
    const std::size_t n = static_cast<std::size_t>(12 * (1 + directions));
    const Vector W = random_spd(n, 0.3, random), b = random_velocity(n, random);
    const ContactOperator op = make_contact_operator(W, 12, directions);
    const FrictionLaw law{0.2, true, 0.4, 2};
    Vector swept, projected;
    CHECK(solve_contact(op, b, law, {ContactSolver::gauss_seidel, 1e-12, 1000, 0}, swept).converged);
    CHECK(solve_contact(op, b, law, {ContactSolver::fixed_point, 1e-12, 20000, 0}, projected).converged);
    CHECK(difference(swept, projected) < 1e-9); // as with constant friction
    CHECK(difference(swept,
                     [&]
                     {
                       Vector r;
                       solve_contact(op, b, {0.2}, {}, r);
                       return r;
                     }()) > 1e-3);
  }
}

TEST_CASE("a pair sticks below the Coulomb limit and slips above it, against the sliding")
{
  const PairBlock A = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  CHECK(solve_pair(A, {-2, 0.6, -0.7}, 2, {0.5}, {}) == PairVector{2, -0.6, 0.7}); // 0.92 < 1: stick
  const PairVector r = solve_pair(A, {-2, 3, -4}, 2, {0.5}, {});                   // 5 > 1: slip along (-0.6, 0.8)
  CHECK(std::abs(r[0] - 2) + std::abs(r[1] + 0.6) + std::abs(r[2] - 0.8) < 1e-14);
  CHECK(solve_pair(A, {1e-20, 3, 4}, 2, {0.5}, {1, 0, 0}) == PairVector{0, 0, 0});
  const PairVector plane = solve_pair(A, {-2, -3, 0}, 1, {0.5}, {});
  CHECK(plane == PairVector{2, 1, 0});
}

TEST_CASE("an immovable direction gets no reaction at rest and never a number that is not one")
{
  const PairBlock A = {{{2, 0, 0}, {0, 0, 0}, {0, 0, 0}}};
  CHECK(solve_pair(A, {-1, 0, 0}, 1, {0.3}, {}) == PairVector{0.5, 0, 0});
  CHECK(solve_pair(A, {-1, 0, 0}, 2, {0.3}, {}) == PairVector{0.5, 0, 0});
  const PairBlock fixed{};
  CHECK(solve_pair(fixed, {-1, 1, 1}, 2, {0.3}, {}) == PairVector{0, 0, 0});
  const PairBlock one = {{{2, 0, 0}, {0, 1, 0}, {0, 0, 0}}}; // t2 immovable, pair at rest along it
  CHECK(solve_pair(one, {-1, 0.1, 0}, 2, {0.3}, {}) == PairVector{0.5, -0.1, 0});
  CHECK(std::abs(solve_pair(one, {-1, 5, 0}, 2, {0.3}, {})[1] + 0.15) < 1e-15);
}

TEST_CASE("the natural map is zero on a solution, and sees each law broken")
{
  CHECK(natural_map({1, -0.5, 0}, {0, 2, 0}, {0.5}, {1, 1}) == 0);
  CHECK(natural_map({0, 0, 0}, {1, 2, 3}, {0.5}, {1, 1}) == 0);
  CHECK(natural_map({0, 0, 0}, {-1, 0, 0}, {0.5}, {1, 1}) == 1);  // penetrates
  CHECK(natural_map({1, 0, 0}, {2, 0, 0}, {0.5}, {1, 1}) == 1);   // pushes while open
  CHECK(natural_map({1, 0.5, 0}, {0, 2, 0}, {0.5}, {1, 1}) == 1); // pushes along the sliding
}

TEST_CASE("Gauss-Seidel and the projection fixed point find the same reactions")
{
  std::mt19937 random(7);
  for (const int directions : {1, 2})
    for (const double mu : {0., 0.2, 0.5})
    {
      const int pairs = 12;
      const std::size_t n = static_cast<std::size_t>(pairs * (1 + directions));
      const Vector W = random_spd(n, 0.3, random), b = random_velocity(n, random);
      const ContactOperator op = make_contact_operator(W, pairs, directions);
      Vector swept, projected;
      const auto first = solve_contact(op, b, {mu}, {ContactSolver::gauss_seidel, 1e-12, 1000, 0}, swept);
      const auto second = solve_contact(op, b, {mu}, {ContactSolver::fixed_point, 1e-12, 20000, 0}, projected);
      CHECK(first.converged);
      CHECK(second.converged);
      CHECK(first.residual <= 1e-12);
      // the residual bounds the error up to the condition of W, which is below 100 here
      CHECK(difference(swept, projected) < 1e-9);
      CHECK(contact_residual(op, FrictionLaw{mu}, b, swept) <= 1e-12);
    }
}

TEST_CASE("a converged answer satisfies the residual when w is formed afresh, or says that it did not converge")
{
  std::mt19937 random(11);
  int solved = 0;
  for (int trial = 0; trial < 60; ++trial)
  {
    const int pairs = 6, directions = 1 + trial % 2;
    const std::size_t n = static_cast<std::size_t>(pairs * (1 + directions));
    const double mu = trial % 3 == 0 ? 5 : 1; // coupling far beyond what either solver is sure of
    const Vector W = random_spd(n, 1e-6, random), b = random_velocity(n, random);
    const ContactOperator op = make_contact_operator(W, pairs, directions);
    Vector r;
    const auto result = solve_contact(op, b, {mu}, {ContactSolver::gauss_seidel, 1e-10, 2000, 0}, r);
    const double truth = contact_residual(op, FrictionLaw{mu}, b, r);
    CHECK(result.converged == (result.residual <= 1e-10));
    if (result.converged) CHECK(truth < 2e-10); // another order of summation
    solved += result.converged ? 1 : 0;
  }
  CHECK(solved > 50); // 20 of these have mu = 5
}

TEST_CASE("forces a million times larger or smaller give the same relative answer")
{
  std::mt19937 random(13);
  const int pairs = 8;
  const Vector W = random_spd(24, 0.2, random), b = random_velocity(24, random);
  const ContactOperator op = make_contact_operator(W, pairs, 2);
  Vector reference;
  CHECK(solve_contact(op, b, {0.3}, {ContactSolver::gauss_seidel, 1e-12, 1000, 0}, reference).converged);
  for (const double factor : {1e6, 1e-6, 1e-20})
  {
    Vector scaled = b, r;
    for (double& value : scaled) value *= factor;
    CHECK(solve_contact(op, scaled, {0.3}, {ContactSolver::gauss_seidel, 1e-12, 1000, 0}, r).converged);
    for (double& value : r) value /= factor;
    CHECK(difference(r, reference) < 1e-10);
  }
}

TEST_CASE("a warm start at the solution takes no sweep, and an inadmissible one does no harm")
{
  std::mt19937 random(17);
  const Vector W = random_spd(24, 0.2, random), b = random_velocity(24, random);
  const ContactOperator op = make_contact_operator(W, 8, 2);
  Vector r;
  const ContactSettings settings{ContactSolver::gauss_seidel, 1e-12, 1000, 0};
  CHECK(solve_contact(op, b, {0.3}, settings, r).converged);
  Vector again = r;
  const auto result = solve_contact(op, b, {0.3}, settings, again);
  CHECK(result.iterations <= 1); // rounding of w alone
  Vector wild(24, std::nan(""));
  wild[0] = -5;
  CHECK(solve_contact(op, b, {0.3}, settings, wild).converged);
  CHECK(difference(wild, r) < 1e-10);
}

TEST_CASE("what is not a number ends as not converged")
{
  Vector W = {1, 0, 0, 1}, r;
  CHECK_FALSE(solve_contact(make_contact_operator(W, 1, 1), {std::nan(""), 0}, {0.3}, {}, r).converged);
}

TEST_CASE("a contact that carries little is judged by what it carries, beside one that carries much")
{
  const ContactOperator W = make_contact_operator({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, 2, 1);
  const Vector b = {-2e4, 0, -2e4, 0};
  const Vector r = {2e4, 0, 2e4, 1e-2};
  PairFriction friction(FrictionLaw{0.4});
  const double together = contact_residual(W, friction, b, r);
  friction.contact = {0, 1};
  CHECK(contact_residual(W, friction, b, r) == doctest::Approx(together).epsilon(1e-12));
  const Vector light_b = {-2e4, 0, -10, 0}, light_r = {2e4, 0, 10, 1e-2};
  CHECK(contact_residual(W, friction, light_b, light_r) == doctest::Approx(1e-3).epsilon(1e-3));
  const Vector status_of = {2e4, 0, 1e-5, 0};
  CHECK(contact_status(PairView<const double>(status_of, 1), PairView<const double>(status_of, 1), friction)[1] ==
        ContactStatus::stick);
}

TEST_CASE("a pair slips from its first motion on where friction falls with speed")
{
  const FrictionLaw law{0.3, true, 0.5, 1};
  for (const double speed : {1e-6, 1e-7})
  {
    const double mu = friction_coefficient(law, speed / 2).value; // a step takes it at half of w_t
    CHECK(contact_status({1, mu, 0}, {0, -speed, 0}, law, 1) == ContactStatus::slip);
    CHECK(contact_status({1, 0.49, 0}, {0, -speed, 0}, law, 1) == ContactStatus::stick);
  }
}

TEST_CASE("light plates between two bodies take few sweeps")
{
  // five bodies on each other: W is the difference of their velocities by unit forces, along the normal and the tangent
  constexpr std::size_t contacts = 4, rows = 2 * contacts;
  const std::array<double, contacts + 1> inverse_mass = {1, 1e3, 1e3, 1e3, 1};
  Vector W(rows * rows, 0.), b;
  for (std::size_t i = 0; i < contacts; ++i)
  {
    for (const std::size_t row : {2 * i, 2 * i + 1})
    {
      W[row * rows + row] = inverse_mass[i] + inverse_mass[i + 1];
      if (i > 0) W[row * rows + row - 2] = W[(row - 2) * rows + row] = -inverse_mass[i];
    }
    b.insert(b.end(), {-0.25, 0.05});
  }
  Vector r;
  const ContactResult result = solve_contact(make_contact_operator(W, contacts, 1), b, {0.3}, {}, r);
  CHECK(result.converged);
  CHECK(result.iterations < 40); // sweeps alone leave some 0.999 of the error each
  // stuck together they carry their common motion: the outer ones have forces of half their relative motion, nearly
  for (std::size_t i = 0; i < contacts; ++i)
  {
    CHECK(r[2 * i] == doctest::Approx(0.5).epsilon(2e-3));
    CHECK(r[2 * i + 1] == doctest::Approx(-0.1).epsilon(2e-3));
  }
}
