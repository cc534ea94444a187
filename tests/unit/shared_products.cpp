// ranks: 1 2 3 4
// A W whose columns ranks share, against the same one as a whole: rounding of two ways to one matrix.
#include "../support/contact_problem.hpp"
#include "../support/small_models.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/contact/contact_operator.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;

namespace
{

std::vector<double> product(const ContactOperator& W, const std::vector<double>& x)
{
  std::vector<double> y(x.size());
  W.multiply(x, y);
  return y;
}

} // namespace

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

TEST_CASE("a W whose columns are on all ranks is the whole one in products, blocks, near field and solutions")
{
  const MPI_Comm comm = PETSC_COMM_WORLD;
  const test::Rows K = grid_stiffness();
  for (const FactorKind kind : {FactorKind::supernodal, FactorKind::mumps})
    for (const int pairs : {100, 400}) // too few to share, and not
    {
      const std::size_t rows = 3 * static_cast<std::size_t>(pairs);
      test::Rows B = test::zeros(rows, K.size()); // each pair has three nodes of the grid
      for (std::size_t i = 0; i < rows; ++i) B[i][i] = 1;
      const auto structure = test::make_structure(K, K, K, std::vector<double>(K.size(), 1.));
      const auto interface = test::make_interface(B, 2, std::vector<double>(pairs, 0.),
                                                  std::vector<double>(2 * pairs, 1.), 0.3, structure.K);
      constexpr double scale = 2.5;
      std::vector<double> added(rows, 0.);
      for (std::size_t i = 0; i < added.size(); i += 6) added[i] = 0.3;
      std::vector<double> entries = factor_held(structure.K, interface, {}, {.kind = kind}).condensed(scale);
      for (std::size_t i = 0; i < added.size() && !entries.empty(); ++i) entries[i * added.size() + i] += added[i];
      broadcast(entries, comm);
      const Factor factor = factor_held(structure.K, interface, {}, {.kind = kind});
      const ContactOperator W = make_contact_operator(factor, scale, added, pairs, 2, comm);
      const bool shared = ranks_of(comm) > 1 && pairs == 400;
      CHECK((W.shared_by() != MPI_COMM_NULL) == shared);
      W.hold_whole();
      if (rank_of(comm) == 0) CHECK(largest_difference({W.entries().begin(), W.entries().end()}, entries) < 1e-12);
      if (rank_of(comm) != 0 && !shared) continue;
      const ContactOperator whole = make_contact_operator(entries, pairs, 2);
      CHECK(W.size() == whole.size());
      CHECK(W.has_near_field());
      for (std::size_t pair = 0; pair < W.pairs(); ++pair)
        for (std::size_t k = 0; k < 3; ++k)
          for (std::size_t l = 0; l < 3; ++l)
            CHECK(std::abs(W.diagonal(pair)[k][l] - whole.diagonal(pair)[k][l]) < 1e-12);
      std::vector<double> x(W.size());
      for (std::size_t i = 0; i < x.size(); ++i) x[i] = std::sin(static_cast<double>(i));
      for (int round = 0; round < 3; ++round) CHECK(largest_difference(product(W, x), product(whole, x)) < 1e-12);
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
