/// Frequency responses against dense algebra (src/README.md, section 13).
// ranks: 1 2
#include "squeal/study/response.hpp"
#include "../support/linearised.hpp"
#include "../support/sliding_oscillator.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/constants.hpp"

#include <cmath>
#include <doctest/doctest.h>
#include <Eigen/LU>

using namespace squeal;
using namespace squeal::test;
using Complex = std::complex<double>;

namespace
{

/// Probes of single degrees of freedom.
Owned<Mat> probes_at(const std::vector<int>& dofs, std::size_t size)
{
  Rows rows = zeros(dofs.size(), size);
  for (std::size_t i = 0; i < dofs.size(); ++i) rows[i][static_cast<std::size_t>(dofs[i])] = 1;
  return sparse(rows, rows);
}

std::vector<double> evenly(double from, double to, int count)
{
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(from + i * (to - from) / (count - 1));
  return values;
}

/// A model about its equilibrium, with probes that are all driven.
struct Driven
{
  SmallModel model;
  Equilibrium equilibrium;
  Owned<Mat> probes;
  LinearisedSliding linearised = linearise({model.structure, model.interface, equilibrium});

  Response response(const std::vector<double>& frequencies, const ResponseOptions& options = {}) const
  {
    PetscInt count = 0;
    check(MatGetSize(probes, &count, nullptr));
    std::vector<int> all;
    for (PetscInt i = 0; i < count; ++i) all.push_back(static_cast<int>(i));
    const ModesOptions modes;
    return find_response({{model.structure, model.interface, equilibrium}, probes, all, frequencies, options, modes});
  }
};

/// The receptances at omega by dense algebra, excitations in columns.
Eigen::MatrixXcd dense_receptance(const Driven& driven, double omega)
{
  const Structure& s = driven.model.structure;
  const Eigen::MatrixXd Y = dense_copy(driven.linearised.contact.Y), Z = dense_copy(driven.linearised.contact.Z),
                        P = dense_copy(driven.probes);
  Eigen::MatrixXcd Q = (dense_copy(s.K) - omega * omega * dense_copy(s.M)).cast<Complex>();
  Q += Complex(0, omega) * dense_copy(driven.linearised.C);
  if (s.K_loss.get()) Q += Complex(0, 1 - omega / s.loss_omega) * dense_copy(s.K_loss);
  const Eigen::MatrixXcd projected = Y.transpose() * Q * Z, forces = (Y.transpose() * P.transpose()).cast<Complex>();
  return P * Z * projected.partialPivLu().solve(forces);
}

/// The largest error of all receptances over the largest receptance at the frequency.
double error_of(const Driven& driven, const Response& response)
{
  double error = 0;
  for (std::size_t f = 0; f < response.frequency_hz.size(); ++f)
  {
    const Eigen::MatrixXcd exact = dense_receptance(driven, two_pi * response.frequency_hz[f]);
    for (Eigen::Index i = 0; i < exact.cols(); ++i)
      for (Eigen::Index j = 0; j < exact.rows(); ++j)
        error =
            std::max(error, std::abs(response.receptance[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)][f] -
                                     exact(j, i)) /
                                exact.cwiseAbs().maxCoeff());
  }
  return error;
}

/// The largest difference of H_ij and H_ji over the largest receptance.
double asymmetry_of(const Response& response)
{
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < response.receptance.size(); ++i)
    for (std::size_t j = 0; j < response.receptance.size(); ++j)
      for (std::size_t f = 0; f < response.frequency_hz.size(); ++f)
      {
        difference = std::max(difference, std::abs(response.receptance[i][j][f] - response.receptance[j][i][f]));
        size = std::max(size, std::abs(response.receptance[i][j][f]));
      }
  return difference / size;
}

void join(Rows& A, std::size_t i, std::size_t j, double k)
{
  A[i][i] += k;
  A[j][j] += k;
  A[i][j] -= k;
  A[j][i] -= k;
}

/// 150 masses on a line, with springs of ten strengths, those of the first half with a loss factor. Three pairs slide,
/// each between two masses and with friction on a third.
Driven sliding_chain(double friction)
{
  constexpr std::size_t n = 150;
  constexpr double loss_omega = 2;
  Rows K = zeros(n, n), C = zeros(n, n), loss = zeros(n, n), B = zeros(6, n);
  for (std::size_t i = 0; i + 1 < n; ++i)
  {
    const double k = 1 + static_cast<double>(i % 10);
    join(K, i, i + 1, k);
    join(C, i, i + 1, 1e-3 * k);
    if (2 * i < n) join(loss, i, i + 1, 0.01 * k);
    K[i][i] += 0.3;
  }
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) C[i][j] += loss[i][j] / loss_omega;
  for (std::size_t pair = 0; pair < 3; ++pair)
  {
    const std::size_t first = 20 + 45 * pair;
    B[2 * pair][first] = 1;
    B[2 * pair][first + 3] = -1;
    B[2 * pair + 1][first + 8] = 1;
  }
  SmallModel model;
  model.structure = make_structure(diagonal(std::vector<double>(n, 1.)), C, K, std::vector<double>(n, 0.));
  model.structure.K_loss = sparse(loss, K);
  model.structure.loss_omega = loss_omega;
  model.interface = make_interface(B, 1, {0, 0, 0}, {1, 1, 1}, friction, model.structure.K);
  Equilibrium equilibrium;
  equilibrium.outcome.kind = OutcomeKind::converged;
  equilibrium.u = zeros_like(model.structure.load);
  equilibrium.reactions = {1, friction, 1, friction, 1, friction};
  equilibrium.directions = 1;
  equilibrium.closed = {1, 1, 1};
  return {std::move(model), std::move(equilibrium), probes_at({10, 77, 140}, n)};
}

} // namespace

TEST_CASE("the sliding oscillator responds as its equations solved by hand")
{
  for (const double mu : {0., 0.3})
  {
    CAPTURE(mu);
    SmallModel oscillator = unilateral_oscillator(mu, 0.6);
    Equilibrium steady = sliding_equilibrium(oscillator);
    const Driven driven{std::move(oscillator), std::move(steady), probes_at({0, 1, 2}, 3)};
    const Response response = driven.response(evenly(0.01, 1, 101), {});
    CHECK(response.outcome.kind == OutcomeKind::converged);
    double error = 0, size = 0;
    for (std::size_t f = 0; f < response.frequency_hz.size(); ++f)
    {
      // pad: A x - 0.1 y = f_x + mu r, (A - 0.6) y - 0.1 x = f_1 + r;   disc: D y = f_2 - r;   r eliminated
      const double omega = two_pi * response.frequency_hz[f];
      const Complex A(1.1 - omega * omega, 0.02 * omega), D(1.2 - 0.5 * omega * omega, 0.02 * omega);
      const Complex xy = mu * D - 0.1, yy = A - 0.6 + D, determinant = A * yy + 0.1 * xy;
      const std::array<std::array<Complex, 2>, 3> forces = {{{1, 0}, {0, 1}, {mu, 1}}};
      for (std::size_t i = 0; i < 3; ++i)
      {
        const Complex x = (yy * forces[i][0] - xy * forces[i][1]) / determinant,
                      y = (A * forces[i][1] + 0.1 * forces[i][0]) / determinant;
        const std::array<Complex, 3> exact = {x, y, y};
        for (std::size_t j = 0; j < 3; ++j)
        {
          error = std::max(error, std::abs(response.receptance[i][j][f] - exact[j]));
          size = std::max(size, std::abs(exact[j]));
        }
      }
    }
    CHECK(error < 1e-12 * size); // rounding at a condition number of 100
  }
}

TEST_CASE("a mass on a spring with a loss factor responds as by its complex stiffness")
{
  constexpr double m = 2, k = 50, c = 0.3, eta = 0.08, loss_omega = 4;
  SmallModel model;
  model.structure = make_structure({{m}}, {{c + eta * k / loss_omega}}, {{k}}, {0});
  model.structure.K_loss = sparse({{eta * k}}, {{1}});
  model.structure.loss_omega = loss_omega;
  model.interface = make_interface({}, 1, {}, {}, 0, model.structure.K);
  Equilibrium rest;
  rest.outcome.kind = OutcomeKind::converged;
  const Driven driven{std::move(model), std::move(rest), probes_at({0}, 1)};
  const Response response = driven.response(evenly(0.1, 3, 30), {});
  for (std::size_t f = 0; f < 30; ++f)
  {
    const double omega = two_pi * response.frequency_hz[f];
    const Complex exact = 1. / Complex(k - omega * omega * m, k * eta + omega * c);
    CHECK(std::abs(response.receptance[0][0][f] - exact) < 1e-14 * std::abs(exact));
  }
}

TEST_CASE("the basis gives the responses of dense algebra, whatever part of the band it is made for")
{
  for (const double mu : {0., 0.4})
    for (const double highest : {0.2, 0.8})
    {
      CAPTURE(mu);
      CAPTURE(highest);
      const Driven driven = sliding_chain(mu);
      const Response response = driven.response(evenly(0.02, highest, 30));
      CHECK(response.outcome.kind == OutcomeKind::converged);
      CHECK(response.outcome.residual <= 1e-5);
      CHECK(response.shapes < 147); // the kept degrees of freedom
      // The error is the product of residuals of 1e-5 on both sides and of a compliance of about 10 |H|.
      const double error = error_of(driven, response);
      CHECK(error < 1e-8);
      CHECK(error <= std::max(response.change, 1e-12)); // which is that of the basis before, or rounding
    }
}

TEST_CASE("responses are reciprocal without friction alone")
{
  CHECK(asymmetry_of(sliding_chain(0).response(evenly(0.02, 0.8, 60))) < 1e-10);
  CHECK(asymmetry_of(sliding_chain(0.4).response(evenly(0.02, 0.8, 60))) > 1e-2);
}

TEST_CASE("residuals that stay large are no response")
{
  const Response response = sliding_chain(0.4).response(evenly(0.02, 0.8, 4), {.passes = 0});
  CHECK(response.outcome.kind == OutcomeKind::not_converged);
  CHECK(response.outcome.reason.find(" of a unit force are left by a basis of ") != std::string::npos);
}
