// ranks: 1 2 3 4
// Sweeps of ranks that share W: a residual of 1e-10 leaves 1e-8 of a reaction where cond(W) < 100.
#include "../support/contact_problem.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>
#include <limits>

using namespace squeal;
using test::contact_residual;
using test::difference;
using test::solve_contact;

namespace
{

using Vector = std::vector<double>;

constexpr std::size_t pairs = 405, size = 3 * pairs; // many enough for ranks to share W

/// Bodies whose pairs come in turn, W decaying along each. `between`: of pairs of two bodies, wherever they are.
Vector compliance_of_bodies(std::size_t bodies, double between)
{
  Vector W(size * size);
  for (std::size_t i = 0; i < size; ++i)
    for (std::size_t j = 0; j < size; ++j)
    {
      const std::size_t a = i / 3, b = j / 3;
      const double distance = std::abs(static_cast<double>(a / bodies) - static_cast<double>(b / bodies));
      const double along = i % 3 == j % 3 ? 1 : 0.2;
      W[i * size + j] = a % bodies == b % bodies ? along * std::exp(-1.2 * distance) : along * between;
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

/// W on all ranks, each from its own columns of entry(row, column).
template <class Entry> ContactOperator shared_of(Entry entry, std::size_t of_pairs, int directions)
{
  const std::size_t rows = of_pairs * (1 + static_cast<std::size_t>(directions));
  const std::vector<std::size_t> shares = column_shares(rows, PETSC_COMM_WORLD);
  const auto me = static_cast<std::size_t>(rank_of(PETSC_COMM_WORLD));
  Vector columns;
  for (std::size_t j = shares[me]; j < shares[me + 1]; ++j)
    for (std::size_t i = shares[me]; i < rows; ++i) columns.push_back(entry(i, j));
  return {columns, static_cast<int>(of_pairs), directions, PETSC_COMM_WORLD};
}

ContactOperator shared(const Vector& dense, std::size_t of_pairs, int directions)
{
  const std::size_t rows = of_pairs * (1 + static_cast<std::size_t>(directions));
  return shared_of([&](std::size_t i, std::size_t j) { return dense[i * rows + j]; }, of_pairs, directions);
}

constexpr std::size_t large = 1100; // pairs of a patch that ranks divide

/// A body with pairs along a line, W decaying between them and the same between all besides; pair i is at place
/// i * stride of the line.
Vector compliance_of_line(std::size_t stride, double decay, double between)
{
  constexpr std::size_t rows = 2 * large;
  Vector W(rows * rows);
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t j = 0; j < rows; ++j)
    {
      const auto place = [&](std::size_t row) { return static_cast<double>(row / 2 * stride % large); };
      const double along = i % 2 == j % 2 ? 1 : 0.1;
      W[i * rows + j] = along * (std::exp(-decay * std::abs(place(i) - place(j))) + between);
    }
  return W;
}

/// Pairs pressed and moved by waves of some tens of pairs.
Vector velocity_of_line(std::size_t stride)
{
  Vector b;
  for (std::size_t pair = 0; pair < large; ++pair)
  {
    const double phase = 0.2 * static_cast<double>(pair * stride % large);
    b.insert(b.end(), {-1 + 1.5 * std::cos(phase), 2 + std::sin(0.3 * phase)});
  }
  return b;
}

} // namespace

TEST_CASE("ranks sweep over slices of a large contact side by side, to the answer of one rank")
{
  for (const std::size_t stride : {1U, 7U}) // pairs numbered from end to end, and not
  {
    const Vector dense = compliance_of_line(stride, 0.5, 0);
    const ContactOperator W = shared(dense, large, 1);
    const std::size_t sweeping = std::min<std::size_t>(2, static_cast<std::size_t>(ranks_of(PETSC_COMM_WORLD)));
    REQUIRE(W.turns().size() == sweeping); // 500 pairs a rank, and two slices each
    // slices of the line, from either end; pairs up to four places away are neighbours, among which slices part
    constexpr int reach = 4, length = large / 4;
    const auto is_in = [&](std::size_t place, std::size_t slice)
    {
      const int from_start = static_cast<int>(place) - length * static_cast<int>(slice);
      return from_start >= -reach && from_start < length + reach;
    };
    for (std::size_t turn = 0; sweeping > 1 && turn < 2; ++turn)
      for (std::size_t place = 0; place < W.turns()[turn].order.size(); ++place)
      {
        const std::size_t pair = W.turns()[turn].order[place],
                          slice = turn + (place < static_cast<std::size_t>(W.turns()[turn].counts[0]) ? 0 : 2);
        CHECK((is_in(pair * stride % large, slice) || is_in(large - 1 - pair * stride % large, slice)));
      }
    const ContactOperator alone = make_contact_operator(dense, large, 1);
    const Vector b = velocity_of_line(stride);
    Vector together, exact;
    const ContactResult result = solve_contact(W, b, {0.4}, {}, together),
                        of_one = solve_contact(alone, b, {0.4}, {}, exact);
    CHECK(result.converged);
    CHECK(result.iterations <= 1.2 * of_one.iterations); // slices far apart act on each other by less than rounding
    CHECK(contact_residual(alone, FrictionLaw{0.4}, b, together) < 1.01e-10);
    // a residual of 1e-10 of the largest reaction, and cond(W) = 1.1/0.9 (1 + e^-0.5)^2/(1 - e^-0.5)^2 < 21
    CHECK(difference(together, exact) < 1e-8 * *std::max_element(exact.begin(), exact.end()));
    CHECK(std::count(exact.begin(), exact.end(), 0.) > 100); // some pairs are open
  }
}

TEST_CASE("one rank sweeps over a large contact whose slices would push each other as strongly as themselves")
{
  // Of a motion of all pairs alike, a slice of 275 feels 275/(275 + 4) of its own push from the one beside it.
  const Vector dense = compliance_of_line(1, 0.5, 1);
  const ContactOperator W = shared(dense, large, 1);
  CHECK(W.turns().size() == 1);
  CHECK(W.turns()[0].counts[0] == large);
  const Vector b = velocity_of_line(1);
  Vector r;
  CHECK(solve_contact(W, b, {0.3}, {}, r).converged);
  CHECK(contact_residual(make_contact_operator(dense, large, 1), FrictionLaw{0.3}, b, r) < 1.01e-10);
}

TEST_CASE("bodies that act on each other a little have the answer of one rank on all, and that of the fixed point")
{
  // of all others together on a pair, over its own body: 0.05 to 0.1; or each of four other bodies with 81 pairs:
  // 4 * 81 * 0.01 = 3.2 beside 1 + 2 sum of exp(-1.2 k) = 1.9 of its own
  for (const double between : {4e-4, 1e-2})
  {
    const Vector dense = compliance_of_bodies(5, between);
    const ContactOperator W = shared(dense, pairs, 2), alone = make_contact_operator(dense, pairs, 2);
    Vector b = velocity(), together, exact, projected;
    b[3 * 7] = 0.5; // a pair that opens
    CHECK(solve_contact(W, b, {0.4}, {}, together).converged);
    CHECK(solve_contact(alone, b, {0.4}, {}, exact).converged);
    CHECK(solve_contact(W, b, {0.4}, {ContactSolver::fixed_point, 1e-12, 100000, 0}, projected).converged);
    const double largest = *std::max_element(exact.begin(), exact.end());
    CHECK(contact_residual(alone, FrictionLaw{0.4}, b, together) < 1.01e-10);
    CHECK(difference(together, exact) < 1e-8 * largest);
    CHECK(difference(together, projected) < 1e-7 * largest);
    CHECK(std::count(exact.begin(), exact.end(), 0.) > 30); // some pairs are open
  }
}

TEST_CASE("slices that act on each other by more than their blocks say converge by combined sweeps")
{
  // Each slice moves as a whole, and all of them together by x, which changes sign from pair to pair. By sums of blocks
  // the two others of a turn act on a pair by 2 * 250 * 0.08/(5 + 250) = 0.16 of its own slice. But with
  // c = 250 * 0.08/(5 + 250 * 0.08) = 0.8 of its own, x grows by 2 c = 1.6 a round.
  const auto ranks = std::min<std::size_t>(3, static_cast<std::size_t>(ranks_of(PETSC_COMM_WORLD)));
  const std::size_t of_all = 500 * std::max<std::size_t>(ranks, 2);
  const auto entry = [&](std::size_t i, std::size_t j)
  {
    const std::size_t a = i / 2, b = j / 2;
    const double own = i == j ? 5 : 0, slice = a / 250 == b / 250 ? 1 : 0, all = a % 2 == b % 2 ? 0.08 : -0.08;
    return own + (i % 2 == 0 && j % 2 == 0 ? slice + all : 0);
  };
  const ContactOperator W = shared_of(entry, of_all, 1);
  CHECK(W.turns().size() == std::min<std::size_t>(ranks, 2));
  Vector b(2 * of_all, 0.), r;
  for (std::size_t pair = 0; pair < of_all; ++pair)
    b[2 * pair] = -1.5 + std::cos(static_cast<double>(pair * pair % 17));
  const ContactResult result = solve_contact(W, b, {0.3}, {}, r);
  CHECK(result.converged);
  CHECK(contact_residual(W, FrictionLaw{0.3}, b, r) < 1.01e-10);
  ContactSettings settings;
  settings.max_iterations = 3;
  CHECK(solve_contact(W, b, {0.3}, settings, r = {}).iterations == 3);
}
