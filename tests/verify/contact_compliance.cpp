// ranks: 1 2
// Contact with a normal compliance c in series with each pair: r_n = max(0, -g)/c. Exact: a block pressed by N
// approaches by c N and swings on the contact at sqrt(1/(c m)); sliding with friction mu has the stiffness K + (B_n +
// mu B_t)'B_n/c; a free mass thrown onto the contact leaves it after pi sqrt(c m) with its speed.
#include "../support/approx.hpp"
#include "../support/linearised.hpp"
#include "../support/step_checks.hpp"
#include "squeal/reduction/reduced_model.hpp"

#include <Eigen/Dense>
#include <numbers>

using namespace squeal;
using namespace squeal::test;

namespace
{

constexpr double m = 1.3, c = 0.02, N = 1.7;

/// A mass above a rigid ground: x along it, held by a spring, and y, held by k_y and by contact.
SmallModel block(double k_y, double gap, double load)
{
  SmallModel model;
  model.structure = test::make_structure(diagonal({m, m}), diagonal({0, 0}), diagonal({2, k_y}), {0, load});
  model.interface = test::make_interface({{0, 1}, {1, 0}}, 1, {gap}, {1}, 0, model.structure.K);
  model.interface.compliance = {c};
  return model;
}

SmallModel oscillator(double mu, double belt, double compliance)
{
  SmallModel model = unilateral_oscillator(mu, belt);
  if (compliance > 0) model.interface.compliance = {compliance};
  return model;
}

/// The eigenvalue of largest real part of the oscillator that slides on a spring 1/c.
Complex exact_eigenvalue(double mu, double compliance)
{
  Eigen::Matrix3d M = Eigen::Vector3d(1, 1, 0.5).asDiagonal(), C = 0.02 * Eigen::Matrix3d::Identity(), K;
  K << 1.1, -0.1, 0, -0.1, 0.5, 0, 0, 0, 1.2;
  const Eigen::RowVector3d normal(0, 1, -1), tangent(1, 0, 0);
  K += (normal + mu * tangent).transpose() * normal / compliance;
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(6, 6);
  A.topRightCorner(3, 3).setIdentity();
  A.bottomLeftCorner(3, 3) = -M.inverse() * K;
  A.bottomRightCorner(3, 3) = -M.inverse() * C;
  const Eigen::VectorXcd lambda = A.eigenvalues();
  Complex best = lambda[0];
  for (const Complex& value : lambda)
    if (value.real() > best.real() + 1e-12 || (value.real() > best.real() - 1e-12 && value.imag() > 0)) best = value;
  return best;
}

Modes full_modes(const SmallModel& model, const Equilibrium& equilibrium)
{
  ModesSettings settings;
  return test::modes_of(model, equilibrium, settings, {});
}

} // namespace

TEST_CASE("a pressed block approaches by c N, whether a spring or contact alone holds it")
{
  for (const double k_y : {0., 5.})
    for (const double gap : {0., 0.01, -0.003})
    {
      const SmallModel model = block(k_y, gap, -N);
      const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
      REQUIRE(equilibrium.outcome.kind == OutcomeKind::converged);
      const double y = (-N - gap / c) / (k_y + 1 / c); // of k_y y + N = -(gap + y)/c
      CHECK(all_entries(equilibrium.u)[1] == approx(y, 1e-13));
      CHECK(equilibrium.reactions[0] == approx(-(gap + y) / c, 1e-12));
    }
}

TEST_CASE("the block swings on its contact at the frequency of the spring 1/c")
{
  for (const double k_y : {0., 5.})
  {
    const SmallModel model = block(k_y, 0, -N);
    const Modes modes = full_modes(model, find_equilibrium(model.structure, model.interface, {}));
    REQUIRE(modes.modes.size() == 2);
    double highest = 0;
    for (const ComplexMode& mode : modes.modes) highest = std::max(highest, std::abs(mode.lambda.imag()));
    CHECK(highest == approx(std::sqrt((k_y + 1 / c) / m), 1e-13));
    CHECK(modes.count.certified_by != Certificate::none);
  }
}

TEST_CASE("sliding on a spring has the eigenvalues of K + R'B_n/c, and the rigid contact's as c falls")
{
  for (const double mu : {0., 0.2, 0.4})
    for (const double compliance : {1e-3, 0.1, 1.})
    {
      const SmallModel model = oscillator(mu, 1, compliance);
      const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
      const Modes modes = full_modes(model, equilibrium);
      REQUIRE(!modes.modes.empty());
      const ComplexMode& mode = modes.modes.front();
      CHECK(std::abs(mode.lambda - exact_eigenvalue(mu, compliance)) < 1e-10); // 1e-13 of the stiffness 1/c
      const std::vector<double> real = relative(model.interface, mode.real),
                                imaginary = relative(model.interface, mode.imaginary);
      CHECK(std::abs(mode.reactions[0] + Complex(real[0], imaginary[0]) / compliance) < 1e-9);
    }
  const SmallModel rigid = oscillator(0.3, 1, 0);
  const Complex limit = full_modes(rigid, find_equilibrium(rigid.structure, rigid.interface, {})).modes.front().lambda;
  const double coarse = std::abs(exact_eigenvalue(0.3, 1e-3) - limit),
               fine = std::abs(exact_eigenvalue(0.3, 1e-4) - limit);
  CHECK(fine < 1e-3);
  CHECK(coarse / fine == approx(10, 0.05)); // of first order in c
}

TEST_CASE("the reduced model of a spring that stays closed, and of one that may open, has the modes' eigenvalues")
{
  const SmallModel model = oscillator(0.3, 1, 0.1);
  const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
  const Modes modes = full_modes(model, equilibrium);
  for (const bool active : {false, true})
  {
    Reduction reduction;
    reduction.modes = static_cast<PetscInt>(modes.modes.size());
    ReducedModel reduced = reduce({model.structure, model.interface, equilibrium}, modes.modes,
                                  active ? std::vector<int>{0} : std::vector<int>{}, reduction);
    const Eigen::Index n = reduced.size();
    REQUIRE(n == 3);
    if (active) // while it is closed and slides: its normal force, with friction along the drive
      reduced.K += (reduced.H.col(0) + 0.3 * reduced.H.col(1)) * reduced.G.row(0) / reduced.compliance[0];
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(2 * n, 2 * n);
    A.topRightCorner(n, n).setIdentity();
    A.bottomLeftCorner(n, n) = -reduced.M.inverse() * reduced.K;
    A.bottomRightCorner(n, n) = -reduced.M.inverse() * reduced.C;
    const Eigen::VectorXcd lambda = A.eigenvalues();
    for (const ComplexMode& mode : modes.modes)
      CHECK((lambda.array() - mode.lambda).abs().minCoeff() < 1e-10 * std::abs(mode.lambda));
    if (active) CHECK(reduced.gap[0] == approx(-0.1 * equilibrium.reactions[0], 1e-12));
  }
}

TEST_CASE("a step multiplies a small sliding motion by the discrete eigenvalue")
{
  const SmallModel model = oscillator(0.3, 1, 0.1);
  const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
  const Modes modes = full_modes(model, equilibrium);
  for (const double theta : {0.5, 0.7}) check_discrete_motion(model, equilibrium, modes.modes.front(), theta);
}

TEST_CASE("a mass thrown onto the contact comes back as from a spring, by order two")
{
  const double speed = 0.7, gap = 0.05, end = gap / speed + std::numbers::pi * std::sqrt(c * m) + 0.2;
  const double exact = speed * 0.2; // height above the ground
  std::vector<double> errors;
  for (const int steps : {100, 400, 1600})
  {
    const SmallModel model = block(0, gap, 0);
    const ThetaStep step = make_theta_step(model.structure, model.interface, end / steps, 0.5, {});
    State state = state_of(model.structure, {0, 0}, {0, -speed});
    REQUIRE(run_steps(model, step, steps, state) == 0);
    errors.push_back(std::abs(all_entries(state.u)[1] + gap - exact));
    // the steps in which it touches and leaves may change the energy by v^2 h^2/(2 c) each
    CHECK(std::abs(all_entries(state.v)[1] - speed) < std::pow(end / steps, 2) * speed / (m * c));
  }
  CHECK(errors[2] < 1e-4);
  CHECK(errors[2] < errors[0] / 64); // 256, but for where contact begins and ends in its step
}

TEST_CASE("the tangent of steps on a compliant contact is the difference quotient of the steps")
{
  check_tangent(oscillator(0.3, 0.6, 0.05), {{0.2, -2.4, -0.8}, {0.9, 0.1, -0.3}, {0, 1, 0}, {0, 1, 0}});
}
