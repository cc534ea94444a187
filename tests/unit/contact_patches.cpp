// ranks: 1 2 3 4
// Sweeps patch by patch. What ranks do side by side is arithmetic on the same numbers in the same order; products with
// W alone add up in another order, 1e-15 of a reaction a product, and a residual of 1e-10 leaves 1e-8 of a reaction
// where cond(W) < 100.
#include "../support/contact_problem.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>
#include <limits>

using namespace squeal;
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

/// On all ranks.
ContactOperator shared(const Vector& dense, std::size_t of_pairs, int directions)
{
  ContactOperator W;
  if (rank_of(PETSC_COMM_WORLD) == 0) W = make_contact_operator(dense, static_cast<int>(of_pairs), directions);
  W.share(PETSC_COMM_WORLD);
  return W;
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

TEST_CASE("ranks sweep over a single large patch by pieces, to the answer of one rank")
{
  for (const std::size_t stride : {1U, 7U}) // pairs numbered from end to end, and not
  {
    const Vector dense = compliance_of_line(stride, 0.5, 0);
    const ContactOperator W = shared(dense, large, 1);
    const ServedProducts served(W);
    if (rank_of(PETSC_COMM_WORLD) != 0) continue;
    const bool divided = ranks_of(PETSC_COMM_WORLD) > 1;
    CHECK(W.patches_take_turns() == divided);
    CHECK(W.patches().size() == (divided ? 4 : 1));
    // slices of the line, from either end; pairs up to four places away are neighbours, among which slices part
    constexpr int reach = 4, length = large / 4;
    const auto is_in = [&](std::size_t place, std::size_t piece)
    {
      const int from_start = static_cast<int>(place) - length * static_cast<int>(piece);
      return from_start >= -reach && from_start < length + reach;
    };
    for (std::size_t piece = 0; divided && piece < 4; ++piece)
      for (const std::size_t pair : W.patches()[piece])
        CHECK((is_in(pair * stride % large, piece) || is_in(large - 1 - pair * stride % large, piece)));
    const ContactOperator alone = make_contact_operator(dense, large, 1);
    const Vector b = velocity_of_line(stride);
    Vector together, exact;
    const ContactResult result = solve_contact(W, b, {0.4}, {}, together),
                        of_one = solve_contact(alone, b, {0.4}, {}, exact);
    CHECK(result.converged);
    CHECK_FALSE(result.as_one);
    CHECK(result.iterations <= 1.2 * of_one.iterations); // slices far apart act on each other by less than rounding
    CHECK(contact_residual(alone, FrictionLaw{0.4}, b, together) < 1.01e-10);
    // a residual of 1e-10 of the largest reaction, and cond(W) = 1.1/0.9 (1 + e^-0.5)^2/(1 - e^-0.5)^2 < 21
    CHECK(difference(together, exact) < 1e-8 * *std::max_element(exact.begin(), exact.end()));
    CHECK(std::count(exact.begin(), exact.end(), 0.) > 100); // some pairs are open
  }
}

TEST_CASE("a large patch whose pieces would push each other as strongly as themselves stays whole")
{
  // Of a motion of all pairs alike, a piece of 275 feels 275/(275 + 4) of its own push from the one beside it.
  const Vector dense = compliance_of_line(1, 0.5, 1);
  const ContactOperator W = shared(dense, large, 1);
  const ServedProducts served(W);
  if (rank_of(PETSC_COMM_WORLD) != 0) return;
  CHECK(W.patches().size() == 1);
  const Vector b = velocity_of_line(1);
  Vector r;
  CHECK(solve_contact(W, b, {0.3}, {}, r).converged);
  CHECK(contact_residual(make_contact_operator(dense, large, 1), FrictionLaw{0.3}, b, r) < 1.01e-10);
}

TEST_CASE("ranks sweep over patches side by side, to the answer of one rank")
{
  const MPI_Comm comm = PETSC_COMM_WORLD;
  for (const std::size_t bodies : {2U, 5U}) // two: some ranks have none
  {
    // of all others together on a pair, over its own body: 0.05 to 0.1
    const Vector dense = compliance_of_bodies(bodies, 4e-4);
    const ContactOperator W = shared(dense, pairs, 2);
    CHECK(W.patches().size() == bodies);
    CHECK(W.shares_patches() == (ranks_of(comm) > 1));
    for (std::size_t patch = 0; patch < bodies; ++patch)
      for (const std::size_t pair : W.patches()[patch]) CHECK(pair % bodies == patch);
    const ServedProducts served(W);
    if (rank_of(comm) != 0) continue;
    const ContactOperator alone = make_contact_operator(dense, pairs, 2);
    {
      Vector b = velocity(), together, exact;
      b[3 * 7] = 0.5; // a pair that opens
      const ContactResult result = solve_contact(W, b, {0.4}, {}, together),
                          of_one = solve_contact(alone, b, {0.4}, {}, exact);
      CHECK(result.converged);
      CHECK(result.iterations == of_one.iterations);
      CHECK(contact_residual(alone, FrictionLaw{0.4}, b, together) < 1.01e-10);
      CHECK(difference(together, exact) < 1e-12 * *std::max_element(exact.begin(), exact.end()));
      CHECK(std::count(exact.begin(), exact.end(), 0.) > 30); // some pairs are open
    }
  }
}

TEST_CASE("where patches act on each other by more than their blocks say, all pairs are swept as one")
{
  // Each body moves as a whole, and all of them together by x, which changes sign from pair to pair. By sums of blocks
  // the others act on a body by 304 * 0.08/(1 + 100 * 1.0) = 0.23 of itself, but x grows by 3 * 8.1/(8.1 + 5) = 1.9
  // a round.
  const std::size_t bodies = 4, of_one = pairs / bodies;
  Vector dense(size * size, 0.);
  for (std::size_t i = 0; i < size; ++i)
    for (std::size_t j = 0; j < size; ++j)
    {
      const std::size_t a = i / 3, b = j / 3, body = std::min(a / of_one, bodies - 1);
      if (i == j) dense[i * size + j] += 5;
      if (i % 3 != 0 || j % 3 != 0) continue;
      if (body == std::min(b / of_one, bodies - 1)) dense[i * size + j] += 1;
      dense[i * size + j] += 0.08 * (a % 2 == b % 2 ? 1 : -1);
    }
  const ContactOperator W = shared(dense, pairs, 2);
  CHECK(W.patches().size() == bodies);
  const ServedProducts served(W);
  if (rank_of(PETSC_COMM_WORLD) != 0) return;
  Vector b(size, 0.), r;
  for (std::size_t pair = 0; pair < pairs; ++pair) b[3 * pair] = -1.5 + std::cos(static_cast<double>(pair * pair % 17));
  const ContactResult result = solve_contact(W, b, {0.3}, {}, r);
  CHECK(result.converged);
  CHECK(result.iterations > 100); // patch by patch, in vain
  CHECK(result.as_one);
  CHECK(contact_residual(make_contact_operator(dense, pairs, 2), FrictionLaw{0.3}, b, r) < 1.01e-10);
  ContactSettings settings;
  settings.max_iterations = 3;
  CHECK(solve_contact(W, b, {0.3}, settings, r = {}).iterations == 3);
}

TEST_CASE("bodies that act on each other like one are one patch, and the answer is that of the fixed point")
{
  if (rank_of(PETSC_COMM_WORLD) != 0) return;
  // each of four other bodies with 81 pairs: 4 * 81 * 0.01 = 3.2 beside 1 + 2 sum of exp(-1.2 k) = 1.9 of its own
  const ContactOperator coupled = make_contact_operator(compliance_of_bodies(5, 0.01), pairs, 2);
  CHECK(coupled.patches().size() == 1);
  Vector swept, projected;
  const Vector b = velocity();
  CHECK(solve_contact(coupled, b, {0.4}, {}, swept).converged);
  CHECK(solve_contact(coupled, b, {0.4}, {ContactSolver::fixed_point, 1e-12, 100000, 0}, projected).converged);
  CHECK(difference(swept, projected) < 1e-7 * *std::max_element(projected.begin(), projected.end()));
}
