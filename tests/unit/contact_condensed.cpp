// ranks: 1 2 3 4
#include "../support/option.hpp"
#include "../support/small_models.hpp"
#include "squeal/contact/contact_operator.hpp"

#include <array>
#include <cmath>
#include <doctest/doctest.h>
#include <Eigen/Cholesky>

using namespace squeal;

namespace
{

Eigen::MatrixXd matrix_of(const test::Rows& rows)
{
  Eigen::MatrixXd result(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(rows.at(0).size()));
  for (Eigen::Index i = 0; i < result.rows(); ++i)
    for (Eigen::Index j = 0; j < result.cols(); ++j)
      result(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  return result;
}

/// W = scale B A^-1 B'.
std::vector<double> dense_condensed(const test::Rows& A, const test::Rows& B, double scale)
{
  const Eigen::MatrixXd rows = matrix_of(B), W = scale * rows * matrix_of(A).llt().solve(rows.transpose());
  return {W.data(), W.data() + W.size()};
}

/// An uneven chain with springs to ground at every third mass.
test::Rows chain_stiffness(std::size_t n)
{
  test::Rows K = test::diagonal(std::vector<double>(n, 1e-3));
  for (std::size_t i = 0; i < n; ++i)
  {
    if (i % 3 == 0) K[i][i] += 2;
    if (i + 1 == n) break;
    const double k = 1 + 0.1 * static_cast<double>(i % 7);
    K[i][i] += k;
    K[i + 1][i + 1] += k;
    K[i][i + 1] -= k;
    K[i + 1][i] -= k;
  }
  return K;
}

double largest_difference(const std::vector<double>& a, const std::vector<double>& b)
{
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

void check_condensed(const test::Rows& K, const test::Rows& B, int directions)
{
  const auto structure = test::make_structure(K, K, K, std::vector<double>(K.size(), 1.));
  const std::size_t pairs = B.size() / static_cast<std::size_t>(1 + directions);
  const auto interface =
      test::make_interface(B, directions, std::vector<double>(pairs, 0.),
                           std::vector<double>(pairs * static_cast<std::size_t>(directions), 1.), 0.3, structure.K);
  const Factor factor = factor_held(structure.K, interface, {}, {});
  const std::vector<double> W = factor.condensed(2.5);
  if (rank_of(PETSC_COMM_WORLD) == 0)
  {
    REQUIRE(W.size() == B.size() * B.size());
    const auto exact = dense_condensed(K, B, 2.5);
    double scale = 0;
    for (const double value : exact) scale = std::max(scale, std::abs(value));
    CHECK(largest_difference(W, exact) <= 1e-12 * scale); // rounding of two direct solvers
    auto transposed = W;
    for (std::size_t i = 0; i < B.size(); ++i)
      for (std::size_t j = 0; j < B.size(); ++j) transposed[i * B.size() + j] = W[j * B.size() + i];
    CHECK(transposed == W);
  }
  else
    CHECK(W.empty());
  const auto x = zeros_like(structure.load), residual = zeros_like(structure.load);
  solve(factor, structure.load, x);
  check(MatMult(structure.K, x, residual));
  check(VecAXPY(residual, -1, structure.load));
  double defect = 0;
  check(VecNorm(residual, NORM_INFINITY, &defect));
  CHECK(defect < 1e-12);
}

} // namespace

TEST_CASE("W of a chain is B K^-1 B', over several blocks of right-hand sides")
{
  const std::size_t n = 400, pairs = 95; // 285 rows: three blocks, the last one short
  test::Rows B = test::zeros(3 * pairs, n);
  for (std::size_t p = 0; p < pairs; ++p)
  {
    B[3 * p][(4 * p + 7) % n] = 1;
    B[3 * p][(4 * p + 201) % n] = -1;
    B[3 * p + 1][(3 * p + 2) % n] = 0.5;
    if (p % 10 != 0) B[3 * p + 2][p] = 1; // else immovable
  }
  check_condensed(chain_stiffness(n), B, 2);
}

TEST_CASE("W of three degrees of freedom, and of pairs that cannot move at all")
{
  check_condensed({{1.1, -0.1, 0}, {-0.1, 0.5, 0}, {0, 0, 1.2}}, {{0, 1, -1}, {1, 0, 0}}, 1);
  check_condensed({{1.1, -0.1, 0}, {-0.1, 0.5, 0}, {0, 0, 1.2}}, test::zeros(2, 3), 1);
}

TEST_CASE("a structure that nothing holds is refused, and the loose part is named")
{
  for (const bool other_body : {false, true})
  {
    auto K = test::zeros(9, 9);
    const auto held = chain_stiffness(5);
    for (std::size_t i = 0; i < 5; ++i)
      for (std::size_t j = 0; j < 5; ++j) K[i][j] = held[i][j];
    for (std::size_t i = 5; i < 8; ++i) // a free chain, or a free node alone
    {
      const double k = other_body ? 1e3 / 3 : 0;
      K[i][i] += k;
      K[i + 1][i + 1] += k;
      K[i][i + 1] -= k;
      K[i + 1][i] -= k;
    }
    if (!other_body) K[5][5] = K[6][6] = K[8][8] = 1;
    const auto structure = test::make_structure(K, K, K, std::vector<double>(9, 1.));
    const auto interface = test::make_interface(test::zeros(2, 9), 1, {0}, {1}, 0.3, structure.K);
    const auto factored = factor_positive(structure.K, interface, {});
    REQUIRE(factored.loose);
    CHECK((other_body ? *factored.loose >= 5 : *factored.loose == 7));
    CHECK_THROWS_AS(factor_held(structure.K, interface, {}, {}), Error);
  }
}

TEST_CASE("a soft support is a support: twelve decades between springs still factor")
{
  test::Rows K = {{1e12, -1e12}, {-1e12, 1e12 + 1}};
  const auto structure = test::make_structure(K, K, K, {0, 0});
  CHECK(factor_positive(structure.K, Interface{}, {}).loose.has_value() == false);
}

namespace
{

/// A lattice of nodes with `width` degrees of freedom, every node coupled to its neighbours, diagonals included, by
/// full blocks: nodes whose degrees of freedom have equal neighbours, and a few that have not.
test::Rows lattice_stiffness(std::size_t side, std::size_t width)
{
  const std::size_t nodes = side * side * side, n = nodes * width;
  test::Rows K = test::diagonal(std::vector<double>(n, 1.));
  const auto couple = [&](std::size_t a, std::size_t b, double k)
  {
    K[a][a] += k, K[b][b] += k;
    K[a][b] -= k, K[b][a] -= k;
  };
  const auto place = [&](std::size_t node) { return std::array{node % side, node / side % side, node / side / side}; };
  for (std::size_t a = 0; a < nodes; ++a)
    for (std::size_t b = 0; b < a; ++b)
    {
      const auto p = place(a), q = place(b);
      bool near = true;
      for (std::size_t k = 0; k < 3; ++k) near = near && p[k] <= q[k] + 1 && q[k] <= p[k] + 1;
      if (!near) continue;
      for (std::size_t i = 0; i < width; ++i)
        for (std::size_t j = 0; j < width; ++j)
          couple(a * width + i, b * width + j, 0.02 + 0.002 * static_cast<double>((a + 3 * b + i + 2 * j) % 7));
    }
  couple(0, n - 1, 0.5); // neighbours of their own
  couple(1, n / 2, 0.5);
  return K;
}

constexpr std::array factor_kinds = {FactorKind::supernodal, FactorKind::mumps};

/// B A^-1 b of each b, one after the other. Collective.
std::vector<double> dense_forward(const test::Rows& A, const test::Rows& B, std::span<const Vec> b)
{
  std::vector<double> result;
  for (const Vec x : b)
  {
    const std::vector<double> entries = all_entries(x);
    const Eigen::VectorXd right = Eigen::VectorXd::Map(entries.data(), static_cast<Eigen::Index>(entries.size())),
                          read = matrix_of(B) * matrix_of(A).llt().solve(right);
    result.insert(result.end(), read.begin(), read.end());
  }
  return result;
}

/// The condensed operator and both halves of a solve with `columns` right-hand sides, by a factor and densely.
void check_agreement(FactorKind kind, const test::Rows& K, std::size_t rows, std::size_t columns)
{
  const std::size_t n = K.size();
  test::Rows B = test::zeros(rows, n);
  for (std::size_t i = 0; i < rows; ++i) B[i][7 * i + 3] = 1, B[i][n - 1 - i] = -0.7;
  const auto structure = test::make_structure(K, K, K, std::vector<double>(n, 1.));
  const auto interface = test::make_interface(B, 1, std::vector<double>(rows / 2, 0.),
                                              std::vector<double>(rows / 2, 1.), 0.3, structure.K);
  Factor factor(structure.K, interface.B, {.kind = kind});
  CHECK(!factor.failed());
  const bool here = rank_of(PETSC_COMM_WORLD) == 0;
  const std::vector<double> exact = dense_condensed(K, B, 2), condensed = factor.condensed(2);
  CHECK(condensed.empty() == !here);
  if (here) CHECK(largest_difference(condensed, exact) < 1e-12);

  std::vector<Owned<Vec>> loads, solutions;
  std::vector<Vec> b, x;
  for (std::size_t k = 0; k < columns; ++k)
  {
    loads.push_back(copy_of(structure.load));
    check(VecSetValue(loads[k], static_cast<PetscInt>(11 + k), 5, INSERT_VALUES));
    check(VecAssemblyBegin(loads[k]));
    check(VecAssemblyEnd(loads[k]));
    solutions.push_back(zeros_like(structure.load));
    b.push_back(loads[k]);
    x.push_back(solutions[k]);
  }
  const std::vector<double> seen = factor.forward(b), expected = dense_forward(K, B, b);
  CHECK(seen.empty() == !here);
  if (here) CHECK(largest_difference(seen, expected) < 1e-12);
  std::vector<double> lambda(seen.size());
  for (std::size_t i = 0; i < lambda.size(); ++i) lambda[i] = 1 + static_cast<double>(i % 5);
  factor.backward(lambda, x);
  for (std::size_t k = 0; k < columns; ++k)
  {
    // A x + B' lambda = b, the lambda of this column
    const auto residual = copy_of(b[k]);
    check(VecScale(residual, -1));
    check(MatMultAdd(structure.K, x[k], residual, residual));
    std::vector<double> mine(rows);
    if (!lambda.empty()) std::copy_n(&lambda[k * rows], rows, mine.begin());
    MPI_Bcast(mine.data(), static_cast<int>(rows), MPI_DOUBLE, 0, PETSC_COMM_WORLD);
    add_reactions(interface, mine, residual);
    double defect = 0;
    check(VecNorm(residual, NORM_INFINITY, &defect));
    CHECK(defect < 1e-12); // entries of order one: rounding
  }
}

} // namespace

TEST_CASE("factors agree with dense algebra: the condensed operator, both halves of a solve, several columns at once")
{
  const auto lattice = lattice_stiffness(6, 2);
  for (const FactorKind kind : factor_kinds)
  {
    check_agreement(kind, chain_stiffness(60), 6, 2);
    check_agreement(kind, lattice, 30, 1);
    check_agreement(kind, lattice, 30, 11); // more than stand side by side
  }
}

TEST_CASE("a factor is used again and again: later right-hand sides see nothing of earlier ones, bordered or not")
{
  const std::size_t n = 200;
  const auto K = chain_stiffness(n);
  const auto structure = test::make_structure(K, K, K, std::vector<double>(n, 1.));
  test::Rows B = test::zeros(2, n);
  B[0][3] = B[1][150] = 1;
  const auto interface = test::make_interface(B, 1, {0}, {1}, 0.3, structure.K);
  for (const FactorKind kind : factor_kinds)
    for (Mat border : {Mat(nullptr), interface.B.get()})
    {
      const Factor factor(structure.K, border, {.kind = kind});
      const auto x = zeros_like(structure.load), y = zeros_like(structure.load), twice = copy_of(structure.load);
      check(VecScale(twice, 2));
      solve(factor, structure.load, x);
      const std::vector<Vec> loads = {twice, structure.load}, answers = {y, x};
      const std::vector<double> seen = factor.forward(loads);
      factor.backward(std::vector<double>(seen.size(), 0.), answers);
      solve(factor, twice, x);
      check(VecAXPY(x, -1, y));
      double distance = 0, size = 0;
      check(VecNorm(x, NORM_INFINITY, &distance));
      check(VecNorm(y, NORM_INFINITY, &size));
      CHECK(distance < 1e-13 * size); // rounding
    }
}

TEST_CASE("factors with the same options are those of their own matrix and border, their pattern known already or new")
{
  const std::size_t n = 600;
  const FactorOptions options{.kind = FactorKind::supernodal, .known = no_analyses()};
  const auto entries_with = [&](std::size_t reach, double shift, std::size_t row)
  {
    test::Rows K = chain_stiffness(n), B = test::zeros(1, n);
    for (std::size_t i = 0; i < n; ++i) K[i][i] += shift;
    for (std::size_t i = 0; reach > 1 && i + reach < n; ++i) K[i][i + reach] = K[i + reach][i] = 1e-4;
    B[0][row] = 1;
    const auto structure = test::make_structure(K, K, K, std::vector<double>(n, 1.));
    const auto interface = test::make_interface(B, 0, {0}, {}, 0, structure.K);
    const Factor factor(structure.K, interface.B, options);
    const auto x = zeros_like(structure.load), residual = copy_of(structure.load);
    solve(factor, structure.load, x);
    check(VecScale(residual, -1));
    check(MatMultAdd(structure.K, x, residual, residual));
    double left = 0, size = 0;
    check(VecNorm(residual, NORM_INFINITY, &left));
    check(VecNorm(x, NORM_INFINITY, &size));
    CHECK(left < 1e-14 * size); // rounding: rows of five numbers of size 1
    return factor.entries();
  };
  std::vector<double> first;
  for (int round = 0; round < 2; ++round)
    for (std::size_t reach = 1; reach <= 8; ++reach) // more patterns than are kept
    {
      const double one = entries_with(reach, 0, 3), again = entries_with(reach, 1, 3);
      CHECK(again == one);
      CHECK(entries_with(reach, 0, 400) > 0);
      if (round == 0) first.push_back(one);
      CHECK(one == first[reach - 1]);
    }
}

TEST_CASE("a sparse factor says of a matrix with one negative eigenvalue that it failed")
{
  auto K = lattice_stiffness(4, 2);
  K[77][77] = -1;
  const auto structure = test::make_structure(K, K, K, std::vector<double>(K.size(), 1.));
  for (const FactorKind kind : factor_kinds) CHECK(Factor(structure.K, nullptr, {.kind = kind}).failed());
}

TEST_CASE("the memory foreseen for a factor holds its entries, and more with a border than without")
{
  const std::size_t n = 600, rows = 300;
  const auto K = chain_stiffness(n);
  test::Rows B = test::zeros(rows, n);
  for (std::size_t i = 0; i < rows; ++i) B[i][2 * i] = 1;
  const auto structure = test::make_structure(K, K, K, std::vector<double>(n, 1.));
  const auto interface =
      test::make_interface(B, 1, std::vector<double>(150, 0.), std::vector<double>(150, 1.), 0.3, structure.K);
  const auto entries = [&](const FactorOptions& options)
  { return Factor(structure.K, interface.B, options).entries(); };
  const auto foreseen = [&](const FactorOptions& options)
  { return forecast_factor(structure.K, interface.B, options).bytes; };
  const FactorOptions automatic, supernodal{.kind = FactorKind::supernodal}, mumps{.kind = FactorKind::mumps};
  const double bordered = foreseen(automatic);
  CHECK(bordered >= 8 * entries(automatic));
  CHECK(bordered > forecast_factor(structure.K, nullptr, automatic).bytes);
  CHECK(entries(automatic) == entries(supernodal));

  const FactorOptions small{.limit = 0}; // several ranks share it then
  const bool several = ranks_of(PETSC_COMM_WORLD) > 1;
  CHECK(entries(small) == entries(several ? mumps : supernodal));
  CHECK(foreseen(small) >= 8 * entries(small));
  const FactorOptions named{.kind = FactorKind::supernodal, .limit = 0}; // whatever the limit
  CHECK(foreseen(named) == bordered);
  CHECK(entries(named) == entries(automatic));
}
