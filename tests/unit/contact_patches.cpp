// ranks: 1 2 3 4
// Sweeps patch by patch. What ranks do side by side is arithmetic on the same numbers in the same order; products with
// W alone add up in another order, 1e-15 of a reaction a product, and a residual of 1e-10 leaves 1e-8 of a reaction
// where cond(W) < 100.
#include "../support/contact_problem.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;
using test::difference;
using test::solve_contact;

namespace
{

using Vector = std::vector<double>;

constexpr std::size_t patches = 5, pairs_of_one = 81, pairs = patches * pairs_of_one, size = 3 * pairs;

/// Five bodies whose pairs come in turn, W decaying along each. `between`: of pairs of two bodies, wherever they are.
Vector compliance_of_patches(double between)
{
  Vector W(size * size);
  for (std::size_t i = 0; i < size; ++i)
    for (std::size_t j = 0; j < size; ++j)
    {
      const std::size_t a = i / 3, b = j / 3;
      const double distance = std::abs(static_cast<double>(a / patches) - static_cast<double>(b / patches));
      const double along = i % 3 == j % 3 ? 1 : 0.2;
      W[i * size + j] = a % patches == b % patches ? along * std::exp(-1.2 * distance) : along * between;
    }
  return W;
}

Vector velocity()
{
  Vector b(size);
  for (std::size_t i = 0; i < size; ++i)
  {
    const double phase = 0.7 * static_cast<double>(i);
    b[i] = i % 3 == 0 ? -0.5 + std::cos(phase) : 2 * std::sin(0.3 * phase);
  }
  return b;
}

} // namespace

TEST_CASE("ranks sweep over patches side by side, to the answer of one rank")
{
  const MPI_Comm comm = PETSC_COMM_WORLD;
  const Vector dense = compliance_of_patches(4e-4), b = velocity();
  ContactOperator W, alone;
  if (rank_of(comm) == 0) W = alone = make_contact_operator(dense, pairs, 2);
  W.share(comm);
  CHECK(W.patches().size() == patches);
  CHECK(W.shares_patches() == (ranks_of(comm) > 1));
  for (std::size_t patch = 0; patch < patches; ++patch)
    for (const std::size_t pair : W.patches()[patch]) CHECK(pair % patches == patch);
  const ServedProducts served(W);
  if (rank_of(comm) != 0) return;
  for (int round = 0; round < 2; ++round) // ranks serve again and again
  {
    Vector together, exact;
    const ContactResult result = solve_contact(W, b, {0.4}, {}, together),
                        of_one = solve_contact(alone, b, {0.4}, {}, exact);
    CHECK(result.converged);
    CHECK(result.iterations == of_one.iterations);
    CHECK(contact_residual(alone, {0.4}, b, together) < 1.01e-10);
    CHECK(difference(together, exact) < 1e-12 * *std::max_element(exact.begin(), exact.end()));
    CHECK(std::count(exact.begin(), exact.end(), 0.) > 30); // some pairs are open
  }
}

TEST_CASE("problems solved together have the answer of each alone on ranks that share patches")
{
  const MPI_Comm comm = PETSC_COMM_WORLD;
  ContactOperator W;
  if (rank_of(comm) == 0) W = make_contact_operator(compliance_of_patches(4e-4), pairs, 2);
  W.share(comm);
  const ServedProducts served(W);
  if (rank_of(comm) != 0) return;
  std::vector<Vector> b(3, velocity()), r(3);
  std::vector<ContactMemory> memory(3);
  std::vector<ContactProblem> problems;
  for (std::size_t k = 0; k < b.size(); ++k)
  {
    for (double& entry : b[k]) entry *= 1 + 0.3 * static_cast<double>(k);
    problems.push_back({b[k], r[k], memory[k]});
  }
  const std::vector<ContactResult> results = solve_contacts(W, {0.4}, {}, problems);
  for (std::size_t k = 0; k < b.size(); ++k)
  {
    CHECK(results[k].converged);
    Vector alone;
    CHECK(solve_contact(W, b[k], {0.4}, {}, alone).converged);
    CHECK(difference(r[k], alone) < 1e-8 * *std::max_element(alone.begin(), alone.end()));
  }
}

TEST_CASE("bodies that act on each other like one are one patch, and the answer is that of the fixed point")
{
  if (rank_of(PETSC_COMM_WORLD) != 0) return;
  // each of four other bodies with 81 pairs: 4 * 81 * 0.01 = 3.2 beside 1 + 2 sum of exp(-1.2 k) = 1.9 of its own
  const ContactOperator coupled = make_contact_operator(compliance_of_patches(0.01), pairs, 2);
  CHECK(coupled.patches().size() == 1);
  Vector swept, projected;
  const Vector b = velocity();
  CHECK(solve_contact(coupled, b, {0.4}, {}, swept).converged);
  CHECK(solve_contact(coupled, b, {0.4}, {ContactSolver::fixed_point, 1e-12, 100000, 0}, projected).converged);
  CHECK(difference(swept, projected) < 1e-7 * *std::max_element(projected.begin(), projected.end()));
}
