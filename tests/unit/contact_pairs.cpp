// ranks: 1
#include "squeal/contact/interface.hpp"

#include <cmath>
#include <doctest/doctest.h>
#include <Eigen/Core>

using namespace squeal;

namespace
{

using Vector = std::vector<double>;

/// The friction of a sliding pair, r_t = -mu r_n s/|s|.
std::array<double, 2> friction_force(const FrictionLaw& law, double r_n, const std::array<double, 2>& s)
{
  const double speed = std::hypot(s[0], s[1]), mu = friction_coefficient(law, speed).value;
  return {-mu * r_n * s[0] / speed, -mu * r_n * s[1] / speed};
}

} // namespace

TEST_CASE("a contact vector is read and written by pairs, in a std::vector and in an Eigen vector")
{
  for (const int directions : {0, 1, 2})
  {
    const int rows = 1 + directions;
    Vector values(static_cast<std::size_t>(3 * rows));
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<double>(i);
    const PairView view(values, directions);
    REQUIRE(view.pairs() == 3);
    CHECK(view.normal(2) == 2 * rows);
    CHECK(view.tangential(2).size() == static_cast<std::size_t>(directions));
    CHECK(view.vector(1) == PairVector{1. * rows, directions > 0 ? rows + 1. : 0, directions > 1 ? rows + 2. : 0});
    view.set(1, {-1, -2, -3});
    CHECK(view.vector(1) == PairVector{-1, directions > 0 ? -2. : 0, directions > 1 ? -3. : 0});
    CHECK(values[static_cast<std::size_t>(rows) - 1] == rows - 1); // neighbours keep theirs
    CHECK(values[static_cast<std::size_t>(2 * rows)] == 2 * rows);
    Eigen::VectorXd copy = Eigen::VectorXd::Map(values.data(), 3 * rows);
    CHECK(PairView<double>(copy, directions).vector(1) == view.vector(1));
  }
}

TEST_CASE("row numbers and tangential vectors follow the order of contact vectors")
{
  const PairRows<long> rows(2);
  CHECK(rows.normal(4) == 12);
  CHECK(rows.tangential(4) == 13);
  CHECK(rows.pair_of(14) == 4);
  CHECK(rows.component_of(14) == 2);
  CHECK(rows.is_normal(12));
  CHECK_FALSE(rows.is_normal(13));
  Vector e = {1, 2, 3, 4};
  CHECK(TangentView(e, 2).of(1)[0] == 3);
  CHECK(TangentView(e, 1).of(3)[0] == 4);
}

TEST_CASE("the derivatives of sliding friction are those of r_t = -mu r_n s/|s|")
{
  const double r_n = 7, d = 1e-6;
  const std::array<double, 2> s = {0.3, -0.2};
  for (const FrictionLaw& law : {FrictionLaw{0.4}, FrictionLaw{0.4, true, 0.7, 0.5}, FrictionLaw{0.4, true, 0.1, 2},
                                 FrictionLaw{0.4, true, 0, 0, {{0, 0.3, 2}, {1.5, 1.1, 1}}}})
  {
    const SlidingFriction friction = sliding_friction(law, r_n, s);
    for (std::size_t k = 0; k < 2; ++k)
    {
      const double by_normal = (friction_force(law, r_n + d, s)[k] - friction_force(law, r_n - d, s)[k]) / (2 * d);
      CHECK(std::abs(by_normal + friction.along[k]) < 1e-9); // differences of 1e-6: rounding 1e-10, curvature none
      for (std::size_t l = 0; l < 2; ++l)
      {
        std::array<double, 2> more = s, less = s;
        more[l] += d, less[l] -= d;
        const double by_sliding = (friction_force(law, r_n, more)[k] - friction_force(law, r_n, less)[k]) / (2 * d);
        CHECK(std::abs(by_sliding + friction.damping[k][l]) < 1e-8); // of 10 N s/m: rounding 1e-9, curvature 1e-10
      }
    }
    const std::array<double, 2> rest = {0, 0};
    CHECK(sliding_friction(law, r_n, rest).damping[0][0] == 0);
    FrictionLaw higher = law, lower = law;
    higher.coefficient += d, lower.coefficient -= d;
    const double more = friction_coefficient(higher, 1).value, less = friction_coefficient(lower, 1).value;
    CHECK(std::abs((more - less) / (2 * d) - share_of_coefficient(law, 1)) < 1e-9);
  }
}

TEST_CASE("friction opposes s_theta, but s+ where the pair stuck or where its solution turns back")
{
  const Vector velocity = {9, 3, 9, 3, 9, 3, 9, 3}, drive = {1, 1, 1, 1}; // s = 2
  const std::vector<ContactStatus> status = {ContactStatus::slip, ContactStatus::stick, ContactStatus::open,
                                             ContactStatus::slip};
  Vector past = past_sliding(PairView(velocity, 1), TangentView(drive, 1), status, 0.5);
  CHECK(past == Vector{0, 1, 0, 0, 0, 1, 0, 1});                                 // nothing on normal rows
  const Vector r = {1, 0, 1, 0, 0, 0, 1, 0}, w = {0, 0.5, 0, -5, 0, -5, 0, 1.5}; // s+: -0.5, -5, -6, 0.5
  CHECK(leave_out_where_turned(PairView(r, 1), PairView(w, 1), PairView(past, 1)));
  CHECK(past == Vector{0, 0, 0, 0, 0, 1, 0, 1}); // the third pair is open, the fourth slides on
  CHECK(opposes_end(PairView<const double>(past, 1), 0));
  CHECK_FALSE(opposes_end(PairView<const double>(past, 1), 3));
  CHECK_FALSE(leave_out_where_turned(PairView(r, 1), PairView(w, 1), PairView(past, 1)));
  CHECK(past_sliding(PairView(velocity, 1), TangentView(drive, 1), status, 0) == Vector(8, 0.)); // s+ everywhere
}

TEST_CASE("what is admissible stays, what is not goes to the cone along its normal and its tangential part")
{
  CHECK(admissible({2, 0.5, -0.5}, {}, {0.5}) == PairVector{2, 0.5, -0.5});
  const PairVector onto_cone = admissible({2, 3, 4}, {}, {0.5});
  CHECK(onto_cone[0] == 2);
  CHECK(std::abs(onto_cone[1] - 0.6) < 1e-15); // rounding of one division
  CHECK(std::abs(onto_cone[2] - 0.8) < 1e-15);
  CHECK(admissible({-2, 3, 4}, {}, {0.5})[0] == 0);
  CHECK(length(admissible({-2, 3, 4}, {}, {0.5})[1], admissible({-2, 3, 4}, {}, {0.5})[2]) == 0);
}
