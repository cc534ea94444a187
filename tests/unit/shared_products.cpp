// ranks: 1 2 3 4
// Products with W of columns that ranks share, against the product on rank 0 alone: rounding of sums of 1203 numbers of
// size 1, 1e-11. A W that stays in the factor, against the same one as a whole: rounding of two ways to one matrix.
#include "../support/contact_problem.hpp"
#include "../support/small_models.hpp"
#include "squeal/contact/condensed.hpp"
#include "squeal/contact/contact_operator.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;

namespace
{

std::vector<double> symmetric_matrix(std::size_t size)
{
  std::vector<double> W(size * size);
  for (std::size_t i = 0; i < size; ++i)
    for (std::size_t j = 0; j < size; ++j)
      W[i * size + j] = std::cos(static_cast<double>(i * j % 101)) + (i == j ? 30. : 0.);
  return W;
}

std::vector<double> product(const ContactOperator& W, const std::vector<double>& x)
{
  std::vector<double> y(x.size());
  W.multiply(x, y);
  return y;
}

} // namespace

TEST_CASE("ranks form products together, again and again, and what they do in between is their own")
{
  const MPI_Comm comm = PETSC_COMM_WORLD;
  for (const int pairs : {7, 401}) // too small to share, and no whole number of strips
  {
    const std::size_t size = 3 * static_cast<std::size_t>(pairs);
    const bool first = rank_of(comm) == 0;
    ContactOperator W, alone;
    if (first) W = alone = make_contact_operator(symmetric_matrix(size), pairs, 2);
    W.share(comm);
    for (int round = 0; round < 3; ++round)
    {
      const ServedProducts served(W);
      for (int k = 0; first && k <= round; ++k)
      {
        std::vector<double> x(size);
        for (std::size_t i = 0; i < size; ++i) x[i] = std::sin(static_cast<double>(i) + k);
        const std::vector<double> together = product(W, x), exact = product(alone, x);
        for (std::size_t i = 0; i < size; ++i) CHECK(std::abs(together[i] - exact[i]) < 1e-11);
      }
    }
    double sum = 1;
    MPI_Allreduce(MPI_IN_PLACE, &sum, 1, MPI_DOUBLE, MPI_SUM, comm); // ranks have left the service
    CHECK(sum == ranks_of(comm));
  }
}

namespace
{

constexpr std::size_t side = 18, layers = 5; // of a grid of springs; every node is held by a spring of its own

test::Rows grid_stiffness()
{
  const std::size_t n = side * side * layers;
  test::Rows K = test::zeros(n, n);
  const auto tie = [&](std::size_t i, std::size_t j)
  {
    K[i][i] += 1, K[j][j] += 1;
    K[i][j] -= 1, K[j][i] -= 1;
  };
  for (std::size_t i = 0; i < n; ++i)
  {
    K[i][i] += 0.4 + 0.01 * static_cast<double>(i % 11);
    if (i % side + 1 < side) tie(i, i + 1);
    if (i / side % side + 1 < side) tie(i, i + side);
    if (i + side * side < n) tie(i, i + side * side);
  }
  return K;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b)
{
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

} // namespace

TEST_CASE(
    "a W in the factor, or by columns on all ranks, is the whole one in products, blocks, near field and solutions")
{
  for (const OperatorStorage storage : {OperatorStorage::by_factor, OperatorStorage::whole})
  {
    const MPI_Comm comm = PETSC_COMM_WORLD;
    const test::Rows K = grid_stiffness();
    constexpr int pairs = side * side / 3; // each has three nodes of the grid's face
    test::Rows B = test::zeros(3 * pairs, K.size());
    for (std::size_t i = 0; i < B.size(); ++i) B[i][i] = 1;
    const auto structure = test::make_structure(K, K, K, std::vector<double>(K.size(), 1.));
    const auto interface = test::make_interface(B, 2, std::vector<double>(pairs, 0.),
                                                std::vector<double>(2 * pairs, 1.), 0.3, structure.K);
    const Factor factor = factor_held(structure.K, interface, {}, {.kind = FactorKind::supernodal});
    constexpr double scale = 2.5;
    std::vector<double> added(B.size(), 0.);
    for (std::size_t i = 0; i < added.size(); i += 6) added[i] = 0.3;
    std::vector<double> entries = factor.condensed(scale);
    for (std::size_t i = 0; i < added.size() && !entries.empty(); ++i) entries[i * added.size() + i] += added[i];
    const auto products = factor.condensed_products();
    REQUIRE(products);
    const ContactOperator W = make_contact_operator({*products, scale, added}, storage, pairs, 2, comm);
    CHECK(W.is_stored() == (storage == OperatorStorage::whole));
    if (W.is_stored()) W.hold_whole();
    if (W.is_stored()) CHECK(largest_difference({W.entries().begin(), W.entries().end()}, entries) < 1e-13);
    const ServedProducts served(W);
    if (rank_of(comm) != 0) continue;
    const ContactOperator whole = make_contact_operator(std::move(entries), pairs, 2);
    CHECK(whole.is_stored());
    CHECK(W.size() == whole.size());
    CHECK(W.has_near_field());
    CHECK(W.near_share() == whole.near_share());
    CHECK(W.near_share() < 0.9);
    for (std::size_t pair = 0; pair < W.pairs(); ++pair)
      for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t l = 0; l < 3; ++l)
          CHECK(std::abs(W.diagonal(pair)[k][l] - whole.diagonal(pair)[k][l]) < 1e-13);
    std::vector<double> x(W.size());
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = std::sin(static_cast<double>(i));
    CHECK(largest_difference(product(W, x), product(whole, x)) < 1e-12);
    std::vector<double> b(W.size()), r, r_whole, r_fixed;
    for (std::size_t i = 0; i < b.size(); ++i)
      b[i] = i % 3 == 0 ? -0.5 + std::cos(0.7 * static_cast<double>(i)) : std::sin(0.3 * static_cast<double>(i));
    CHECK(test::solve_contact(W, b, {0.4}, {}, r).converged);
    CHECK(test::solve_contact(whole, b, {0.4}, {}, r_whole).converged);
    CHECK(test::solve_contact(W, b, {0.4}, {ContactSolver::fixed_point, 1e-11, 20000, 0}, r_fixed).converged);
    CHECK(largest_difference(r, r_whole) < 1e-8); // residuals of 1e-10 at reactions near 1 and a condition below 20
    CHECK(largest_difference(r, r_fixed) < 1e-8);
  }
}
