// ranks: 1
// Where contact solvers fail: the fixed point beyond rho = 2/lambda_max(W), both at large friction and on
// ill-conditioned W; what is not solved must say so.
#include "../support/contact_problem.hpp"
#include "squeal/equilibrium/path_walk.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>
#include <Eigen/Dense>
#include <random>

using namespace squeal;
using test::solve_contact;
using test::uniform;

namespace
{

using Vector = std::vector<double>;

/// A symmetric matrix with eigenvalues spread evenly in the logarithm from 1/condition to 1, in random directions. Rows
/// and columns of pair i are scaled by 10^(spread u_i), u_i in [-1, 1]: pairs of light and heavy bodies.
Vector random_compliance(int pairs, std::size_t block, double condition, double spread, std::mt19937& random)
{
  const auto n = static_cast<Eigen::Index>(pairs * static_cast<int>(block));
  Eigen::MatrixXd H(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j) H(i, j) = uniform(random);
  const Eigen::MatrixXd Q = Eigen::HouseholderQR<Eigen::MatrixXd>(H).householderQ();
  Eigen::VectorXd eigenvalues(n), scale(n);
  for (Eigen::Index i = 0; i < n; ++i)
    eigenvalues(i) = std::pow(condition, -static_cast<double>(i) / static_cast<double>(n - 1));
  for (Eigen::Index i = 0; i < n; ++i)
    scale(i) = i % static_cast<Eigen::Index>(block) == 0 ? std::pow(10, spread * uniform(random)) : scale(i - 1);
  const Eigen::MatrixXd W = scale.asDiagonal() * Q * eigenvalues.asDiagonal() * Q.transpose() * scale.asDiagonal();
  Vector result(static_cast<std::size_t>(n * n));
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j) result[static_cast<std::size_t>(i * n + j)] = (W(i, j) + W(j, i)) / 2;
  return result;
}

/// The worst cone, said without projections and each pair by its own size: Signorini and Coulomb are missed by this
/// part of the free velocity b of the pair (velocities) and of its own reaction (forces).
double worst_cone(const Vector& W, const Vector& b, std::size_t block, double mu, const Vector& r)
{
  const std::size_t n = b.size();
  Vector w = b, flow(n);
  for (std::size_t i = 0; i < n; ++i)
  {
    flow[i] = std::abs(b[i]);
    for (std::size_t j = 0; j < n; ++j)
    {
      w[i] += W[i * n + j] * r[j];
      flow[i] += std::abs(W[i * n + j] * r[j]);
    }
  }
  double worst = 0;
  for (std::size_t i = 0; i < n; i += block)
  {
    const double t2 = block == 3 ? r[i + 2] : 0, s2 = block == 3 ? w[i + 2] : 0;
    const double r_t = std::hypot(r[i + 1], t2), s = std::hypot(w[i + 1], s2), r_n = r[i];
    const double size = std::max(flow[i], std::max(flow[i + 1], block == 3 ? flow[i + 2] : 0.));
    const double power = std::abs(r[i + 1] * w[i + 1] + t2 * s2 + mu * r_n * s); // maximal dissipation
    const double force = std::max(r_n, size / W[i * n + i]);
    worst = std::max({worst, -w[i] / size, std::abs(r_n * w[i]) / (force * size), -r_n / force,
                      (r_t - mu * r_n) / force, power / (force * (1 + mu) * size)});
  }
  return worst;
}

struct Tally
{
  int solved = 0, said = 0;     // said: "not converged"
  double worst = 0, sweeps = 0; // of the solved
};

Tally try_all(double condition, double spread, double mu, int directions)
{
  std::mt19937 random(17);
  Tally tally;
  const auto block = static_cast<std::size_t>(1 + directions);
  for (int trial = 0; trial < 40; ++trial)
  {
    const int pairs = 4 + trial % 9;
    const Vector W = random_compliance(pairs, block, condition, spread, random);
    const ContactOperator op = make_contact_operator(W, pairs, directions);
    Vector b(static_cast<std::size_t>(pairs) * block), r;
    for (double& value : b) value = uniform(random);
    (void)solve_contact(op, b, {mu}, {}, r); // a warm start
    for (double& value : b) value += 0.01 * uniform(random);
    const ContactResult result = solve_contact(op, b, {mu}, {}, r);
    if (!result.converged)
    {
      ++tally.said;
      continue;
    }
    ++tally.solved;
    tally.sweeps += result.iterations;
    tally.worst = std::max(tally.worst, worst_cone(W, b, block, mu, r));
  }
  return tally;
}

} // namespace

TEST_CASE("no cone is left unsolved silently, however ill-conditioned W and however large the friction")
{
  int solved = 0, said = 0;
  for (const int directions : {1, 2})
    for (const double spread : {0., 1., 3.}) // bodies whose mobilities differ by up to 10^(4 spread)
      for (const double condition : {1e1, 1e3, 1e6, 1e10})
        for (const double mu : {0.3, 1., 3.})
        {
          CAPTURE(directions);
          CAPTURE(spread);
          CAPTURE(condition);
          CAPTURE(mu);
          const Tally tally = try_all(condition, spread, mu, directions);
          CHECK(tally.worst < 3e-10); // the contact tolerance is 1e-10; power is a product of both
          if (condition == 1e1 && mu <= 1) CHECK(tally.said == 0);
          if (condition == 1e10 && mu == 3) CHECK(tally.said >= 20);
          solved += tally.solved, said += tally.said;
        }
  CHECK(std::min(solved, said) > 500); // both sides were met
}

TEST_CASE("a light pair beside a heavy one is solved from a warm start too")
{
  const Vector W = {1e-6, 0, 0, 0, 0, 1e-6, 0, 0, 0, 0, 1e6, 0, 0, 0, 0, 1e6}; // reactions of 1e6 and 1e-6
  const ContactOperator op = make_contact_operator(W, 2, 1);
  Vector r;
  REQUIRE(solve_contact(op, {-1, 0, -1, 0}, {0.3}, {}, r).converged);
  REQUIRE(solve_contact(op, {-1, 0, -2, 0}, {0.3}, {}, r).converged);
  CHECK(std::abs(r[0] - 1e6) < 1e-4);
  CHECK(std::abs(r[2] - 2e-6) < 1e-15);
}

namespace
{

/// Iterations of the frictionless fixed point at rho lambda_max = `rho`; -1 if 20000 were not enough.
int fixed_point_iterations(double condition, double rho)
{
  std::mt19937 random(4);
  const Vector W = random_compliance(8, 2, condition, 0, random);
  ContactSettings settings;
  settings.solver = ContactSolver::fixed_point;
  settings.max_iterations = 20000;
  settings.rho = rho;
  Vector r, b(16, 0.);
  for (std::size_t i = 0; i < 16; i += 2) // closed with reactions of the same size: b = -W (1, 0, 1, 0, ...)
    for (std::size_t j = 0; j < 16; j += 2)
    {
      b[i] -= W[i * 16 + j];
      b[i + 1] -= W[(i + 1) * 16 + j];
    }
  // nothing slips: a linear problem
  const ContactResult result = solve_contact(make_contact_operator(W, 8, 1), b, {1e6}, settings, r);
  return result.converged ? result.iterations : -1;
}

} // namespace

TEST_CASE("the fixed point contracts for 0 < rho lambda_max(W) < 2 at a rate set by cond(W), and not beyond")
{
  for (const double condition : {10., 100.})
  {
    CHECK(fixed_point_iterations(condition, 1.9) > 0);
    CHECK(fixed_point_iterations(condition, 2.1) == -1);
    CHECK(fixed_point_iterations(condition, 0) > 0); // chosen, and halved when the residual grows
  }
  // ln(tolerance)/ln(1 - rho lambda_min): proportional to cond(W)/rho, but for the decay of the first iterations
  const double once = fixed_point_iterations(20, 1), tenfold = fixed_point_iterations(200, 1);
  CHECK(tenfold / once == doctest::Approx(10).epsilon(0.2));
  CHECK(fixed_point_iterations(200, 0.5) / tenfold == doctest::Approx(2).epsilon(0.05));
}

TEST_CASE("one equilibrium is promised only where there is one")
{
  std::mt19937 random(21);
  int promised = 0, several = 0, none = 0;
  for (int trial = 0; trial < 400; ++trial)
  {
    constexpr Eigen::Index n = 4;
    Vector entries = random_compliance(4, 1, 20, 0, random);
    for (double& entry : entries) entry += (trial % 4) * 0.3 * uniform(random); // friction couples without symmetry
    const Eigen::MatrixXd M = Eigen::Map<Eigen::Matrix<double, n, n, Eigen::RowMajor>>(entries.data());
    Eigen::VectorXd q(n);
    for (double& gap : q) gap = uniform(random);
    int solutions = 0;
    for (int bits = 0; bits < 16; ++bits)
    {
      Eigen::MatrixXd system = Eigen::MatrixXd::Identity(n, n);
      for (int i = 0; i < n; ++i)
        if ((bits >> i) & 1) system.col(i) = -M.col(i);
      solutions += system.fullPivLu().solve(q).minCoeff() >= 0 ? 1 : 0;
    }
    const StickSlipOperator of =
        make_stick_slip_operator(Eigen::MatrixXd::Identity(n, n), M, M.diagonal().cwiseAbs(), 0, {0, 0, 0, 0});
    if (has_one_solution(of))
    {
      ++promised;
      CHECK(solutions == 1);
      const Vector nothing(n, 0.);
      CHECK(rest_of({of, 0, nothing, {nothing, {}}, {{"load", q, 1}}}, {}).completed);
    }
    several += solutions > 1 ? 1 : 0;
    none += solutions == 0 ? 1 : 0;
  }
  CHECK(promised > 100); // the small side
  CHECK(std::min(several, none) > 20);
}
