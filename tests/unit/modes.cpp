// ranks: 1 2 3
#include "squeal/modes/modes.hpp"
#include "../support/linearised.hpp"
#include "../support/sliding_oscillator.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/algebra/sparse_matrices.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/modes/quadratic.hpp"
#include "squeal/modes/real_modes.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>
#include <random>

using namespace squeal;
using namespace squeal::test;
using Complex = std::complex<double>;

namespace
{

double largest_entry(Mat A)
{
  double norm = 0;
  check(MatNorm(A, NORM_INFINITY, &norm));
  return norm;
}

// A dense elastic body on `pairs` planar contact pairs whose rows overlap, as those of a rigid body do.
SmallModel crowded_model(int dofs, int pairs)
{
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> random(-1, 1);
  const auto n = static_cast<std::size_t>(dofs);
  Rows K = zeros(n, n), C = zeros(n, n), B = zeros(3 * static_cast<std::size_t>(pairs), n);
  std::vector<double> mass(n);
  for (std::size_t i = 0; i < n; ++i)
  {
    mass[i] = 1.5 + random(generator);
    K[i][i] = 10. + 10. * static_cast<double>(i);
    C[i][i] = 0.01 * mass[i] + 1e-4 * K[i][i];
    if (i > 0) K[i][i - 1] = K[i - 1][i] = -3;
    if (i > 0) C[i][i - 1] = C[i - 1][i] = -3e-4;
  }
  for (std::vector<double>& row : B)
    for (std::size_t j = 0; j < 5; ++j) row[j] = random(generator);
  std::vector<double> drive;
  for (int i = 0; i < pairs; ++i) drive.insert(drive.end(), {0.6, 0.8});
  SmallModel model;
  model.structure = make_structure(diagonal(mass), C, K, std::vector<double>(n, 0.));
  model.interface =
      make_interface(B, 2, std::vector<double>(static_cast<std::size_t>(pairs), 0.), drive, 0.3, model.structure.K);
  return model;
}

Equilibrium all_closed(const SmallModel& model)
{
  Equilibrium equilibrium;
  equilibrium.outcome.kind = OutcomeKind::converged;
  equilibrium.u = zeros_like(model.structure.load);
  for (int i = 0; i < model.interface.pairs; ++i)
    equilibrium.reactions.insert(equilibrium.reactions.end(), {2, 0.36, 0.48});
  equilibrium.closed.assign(static_cast<std::size_t>(model.interface.pairs), 1);
  return equilibrium;
}

ModesSettings band_of(double hz)
{
  ModesSettings settings;
  settings.band = hz;
  return settings;
}

} // namespace

TEST_CASE("B_n Z = 0 and (B_n + mu e.B_t) Y = 0, though every pair shares its degrees of freedom with the others")
{
  const SmallModel model = crowded_model(12, 3);
  const ClosedContact closed = eliminate_closed_pairs(model.structure, model.interface, all_closed(model).closed);
  Owned<Mat> BZ, BY;
  check(MatMatMult(model.interface.B, closed.Z, MAT_INITIAL_MATRIX, PETSC_DEFAULT, BZ.put()));
  check(MatMatMult(model.interface.B, closed.Y, MAT_INITIAL_MATRIX, PETSC_DEFAULT, BY.put()));
  const Eigen::MatrixXd Z = dense_copy(BZ), Y = dense_copy(BY);
  REQUIRE(Z.size() == 9 * 9); // three rows a pair, and three of twelve degrees of freedom are gone
  const double mu = model.interface.friction.common.coefficient;
  for (Eigen::Index column = 0; column < 9; ++column)
    for (Eigen::Index i = 0; i < 9; i += 3)
    {
      CHECK(std::abs(Z(i, column)) < 1e-13);
      CHECK(std::abs(Y(i, column) + mu * (0.6 * Y(i + 1, column) + 0.8 * Y(i + 2, column))) < 1e-13);
    }
}

TEST_CASE("the equations of the structure hold with the reactions of each mode, which stays closed")
{
  const SmallModel model = crowded_model(12, 3);
  const Equilibrium equilibrium = all_closed(model);
  const Modes modes = test::modes_of(model, equilibrium, band_of(10), {});
  const Owned<Mat> C = copy_of(model.structure.C);
  check(MatAXPY(C, 1,
                friction_damping(model.interface, equilibrium.closed, equilibrium.reactions, FrictionDamping::whole),
                UNKNOWN_NONZERO_PATTERN));
  REQUIRE(modes.modes.size() == 9);
  for (const ComplexMode& mode : modes.modes)
  {
    Owned<Vec> real = zeros_like(mode.real), imaginary = zeros_like(mode.real);
    quadratic_residual({model.structure.M, C, model.structure.K}, mode.lambda, {mode.real, mode.imaginary},
                       {real, imaginary});
    std::vector<double> r, s;
    for (const Complex rho : mode.reactions)
    {
      r.insert(r.end(), {-rho.real(), -0.3 * 0.6 * rho.real(), -0.3 * 0.8 * rho.real()});
      s.insert(s.end(), {-rho.imag(), -0.3 * 0.6 * rho.imag(), -0.3 * 0.8 * rho.imag()});
    }
    add_reactions(model.interface, r, real);
    add_reactions(model.interface, s, imaginary);
    double norms[2];
    check(VecNorm(real, NORM_INFINITY, &norms[0]));
    check(VecNorm(imaginary, NORM_INFINITY, &norms[1]));
    CHECK(std::hypot(norms[0], norms[1]) < 1e-11 * largest_entry(model.structure.K)); // solver's rounding
    const std::vector<double> gap = relative(model.interface, mode.real);
    for (std::size_t i = 0; i < gap.size(); i += 3) CHECK(std::abs(gap[i]) < 1e-13);
  }
}

TEST_CASE("C_f resists turning of the friction force and nothing else")
{
  const SmallModel model = crowded_model(12, 1);
  const Equilibrium equilibrium = all_closed(model);
  const Owned<Mat> Cf =
      friction_damping(model.interface, equilibrium.closed, equilibrium.reactions, FrictionDamping::whole);
  const Owned<Vec> v = vector_like(model.structure.K, {1, -2, 0.5, 3, 1, 0, 0, 0, 0, 0, 0, 0}), force = zeros_like(v);
  check(MatMult(Cf, v, force));
  double power = 0;
  check(VecDot(v, force, &power));
  const std::vector<double> s = relative(model.interface, v);
  const double across = -0.8 * s[1] + 0.6 * s[2]; // speed across the drive, |v_d| = 1
  CHECK(power == doctest::Approx(0.3 * 2 * across * across).epsilon(1e-13));
}

TEST_CASE("a pair that the others already hold is an error that names it")
{
  SmallModel model = crowded_model(12, 2);
  const Rows one = {
      {0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, {1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, {0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0}};
  Rows twice = one;
  twice.insert(twice.end(), one.begin(), one.end());
  model.interface = make_interface(twice, 2, {0, 0}, {1, 0, 1, 0}, 0.3, model.structure.K);
  CHECK_THROWS_WITH_AS(eliminate_closed_pairs(model.structure, model.interface, all_closed(model).closed),
                       doctest::Contains("contact pair 1"), Error);
}

TEST_CASE("passes and SLEPc find the pairs that LAPACK finds, and the count is confirmed but for what G changes")
{
  SmallModel model = crowded_model(60, 3);
  const auto modes_by = [&](ModesMethod method, const ModesOptions& options)
  {
    ModesSettings settings = band_of(2);
    settings.method = method;
    return test::modes_of(model, all_closed(model), settings, options);
  };
  for (const bool turns : {false, true})
  {
    Rows G = zeros(60, 60);
    G[0][1] = 1e-3;
    G[1][0] = -1e-3;
    if (turns) model.structure.G = sparse(G, G);
    const Modes whole = modes_by(ModesMethod::full, {}), passes = modes_by(ModesMethod::full, {.dense_limit = 10}),
                toar = modes_by(ModesMethod::toar, {.dense_limit = 10});
    REQUIRE(whole.modes.size() > 5);
    for (const Modes* other : {&passes, &toar})
    {
      REQUIRE(other->modes.size() == whole.modes.size());
      CHECK(other->count_check.starts_with(turns ? "NOT confirmed" : "confirmed"));
      for (std::size_t i = 0; i < whole.modes.size(); ++i)
        CHECK(std::abs(other->modes[i].lambda - whole.modes[i].lambda) < 1e-10 * std::abs(whole.modes[i].lambda));
    }
    CHECK(whole.count_check.starts_with("confirmed")); // all pairs are there
  }
}

TEST_CASE("Krylov and LAPACK find the same real modes, M-normalised and closed")
{
  const SmallModel model = crowded_model(60, 3);
  const auto below = [&](double band, const ModesOptions& options)
  { return test::real_modes_of(model, all_closed(model), band, options); };
  const RealModes all = below(10, {});
  REQUIRE(all.omega.size() >= 10);
  const RealModes krylov = below((all.omega[9] + 1e-6) / (2 * M_PI), {.dense_limit = 0});
  CHECK(krylov.outcome.kind == OutcomeKind::converged);
  REQUIRE(krylov.omega.size() == 10);
  for (std::size_t k = 0; k < 10; ++k)
  {
    CHECK(krylov.omega[k] == doctest::Approx(all.omega[k]).epsilon(1e-11));
    CHECK(2 * kinetic_energy(model.structure, krylov.shapes[k]) == doctest::Approx(1).epsilon(1e-11));
    const std::vector<double> gap = relative(model.interface, krylov.shapes[k]);
    CHECK(std::abs(gap[0]) < 1e-12);
  }
}

// omega_k = 2 sqrt(k/m) sin(k pi / 2(N - 1)) of a free bar with lumped mass.
TEST_CASE("a free body moves at no cost: its real mode is 0, and no complex mode is made of it")
{
  const SmallModel bar = mass_spring_chain(30, 1, 100, 1, 0);
  Equilibrium apart;
  apart.outcome.kind = OutcomeKind::converged;
  apart.u = zeros_like(bar.structure.load);
  apart.reactions = {0, 0};
  apart.closed = {0};
  for (const PetscInt limit : {200, 0})
  {
    const ModesOptions options{.dense_limit = limit};
    // 20 sin(4 pi/58) = 4.3, 20 sin(5 pi/58) = 5.4
    const RealModes real = test::real_modes_of(bar, apart, 5 / (2 * M_PI), options);
    const Modes modes = test::modes_of(bar, apart, band_of(3), options);
    REQUIRE(real.omega.size() == 5);
    CHECK(real.omega[0] < 1e-5); // square root of rounding
    for (std::size_t k = 1; k < 5; ++k)
      CHECK(real.omega[k] == doctest::Approx(20 * std::sin(static_cast<double>(k) * M_PI / 58)).epsilon(1e-9));
    CHECK(modes.modes.size() == 22); // 20 sin(k pi/58) < 6 pi from k = 1 to 22
    CHECK(modes.unstable_count == 0);
    CHECK(modes.count_check.starts_with("confirmed"));
  }
}

TEST_CASE("real modes of a part of the spectrum are those of one search")
{
  const SmallModel model = crowded_model(90, 3);
  const Equilibrium equilibrium = all_closed(model);
  const LinearisedSliding linearised = linearise({model.structure, model.interface, equilibrium});
  ModesOptions sparse;
  sparse.dense_limit = 10; // below the model's size
  SUBCASE("between two frequencies")
  {
    const double low = 2, high = 3.5; // [Hz]
    const RealModes all = find_real_modes_below(linearised, high, {}),
                    between = find_real_modes_between(linearised, low, high, sparse);
    const double least = two_pi * low;
    const auto first = std::lower_bound(all.omega.begin(), all.omega.end(), least);
    REQUIRE(all.omega.end() - first > 5);
    REQUIRE(static_cast<std::ptrdiff_t>(between.omega.size()) == all.omega.end() - first);
    for (std::size_t k = 0; k < between.omega.size(); ++k)
      CHECK(between.omega[k] == doctest::Approx(first[static_cast<std::ptrdiff_t>(k)]).epsilon(1e-8));
    CHECK(find_real_modes_between(linearised, high, low, sparse).shapes.empty());
  }
  SUBCASE("in slices")
  {
    const double band = 4.5; // [Hz]
    const RealModes all = solve_real_modes_below(linearised.M_z, linearised.K_z, band, {});
    const RealModes sliced = solve_real_modes_below(linearised.M_z, linearised.K_z, band, sparse);
    REQUIRE(all.omega.size() > 70); // more than one slice
    REQUIRE(sliced.omega.size() == all.omega.size());
    for (std::size_t k = 0; k < all.omega.size(); ++k) // theta is off by the square of the subspace's 1e-7
      CHECK(sliced.omega[k] == doctest::Approx(all.omega[k]).epsilon(1e-12));
  }
}
