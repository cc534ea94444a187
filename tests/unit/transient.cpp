// ranks: 1 2 3
#include "squeal/transient/transient.hpp"
#include "../support/approx.hpp"
#include "../support/option.hpp"
#include "../support/oscillator_mode.hpp"
#include "../support/temporary_folder.hpp"

#include <cmath>
#include <doctest/doctest.h>
#include <fstream>

using namespace squeal;
using test::state_of;
using test::TemporaryFolder;

namespace
{

/// An error whose text holds `part`, on every rank.
template <class Work> void check_error(Work work, const std::string& part)
{
  std::string text;
  try
  {
    work();
  }
  catch (const std::exception& error)
  {
    text = error.what();
  }
  CHECK_MESSAGE(text.find(part) != std::string::npos, text);
}

void cut(const std::filesystem::path& file, std::uintmax_t size)
{
  on_rank_zero(PETSC_COMM_WORLD, [&] { std::filesystem::resize_file(file, size); });
}

} // namespace

TEST_CASE("a state read back is the state that was written, to the bit")
{
  const auto model = test::unilateral_oscillator(0.3, 0.6);
  const State state = state_of(model.structure, {0.1, 1. / 3, -2e-20}, {1e300, -7, 0.3});
  const TemporaryFolder folder;
  const auto file = folder.path / "state.petsc";
  write_state(state, model.structure, file);
  const State back = read_state(file, model.structure);
  CHECK(all_entries(back.u) == all_entries(state.u));
  CHECK(all_entries(back.v) == all_entries(state.v));
  CHECK(!std::filesystem::exists(file.string() + ".part"));
  CHECK(!std::filesystem::exists(file.string() + ".info"));
}

TEST_CASE("a state file is in the order of the mesh, whichever the partition numbered first")
{
  auto model = test::unilateral_oscillator(0.3, 0.6);
  const TemporaryFolder folder;
  const auto file = folder.path / "ordered.petsc";
  model.structure.names.nodal_dof = {7, 0, 3};
  write_state(state_of(model.structure, {7, 0, 3}, {70, 0, 30}), model.structure, file);
  model.structure.names.nodal_dof = {0, 3, 7}; // as another number of ranks would number them
  const State back = read_state(file, model.structure);
  CHECK(all_entries(back.u) == std::vector<double>{0, 3, 7});
  CHECK(all_entries(back.v) == std::vector<double>{0, 30, 70});
}

TEST_CASE("a state file that cannot be used says why on every rank")
{
  const auto model = test::unilateral_oscillator(0.3, 0.6);
  const auto larger = test::mass_spring_chain(4, 1, 1, 0, 0);
  const State state = state_of(model.structure, {1, 2, 3}, {4, 5, 6});
  const TemporaryFolder folder;
  const auto file = folder.path / "broken.petsc";
  const auto read = [&] { (void)read_state(file, model.structure); };

  write_state(state, model.structure, file);
  check_error([&] { (void)read_state(file, larger.structure); }, "has 3 entries, the structure has 4");
  const auto whole = std::filesystem::file_size(file);
  MPI_Barrier(PETSC_COMM_WORLD); // all have seen the size before it changes
  cut(file, whole - 8);
  check_error(read, "truncated");
  cut(file, whole / 2);
  check_error(read, "must hold two vectors");
  cut(file, 5);
  check_error(read, "truncated within its header");
  check_error([&] { (void)read_state(folder.path / "absent.petsc", model.structure); }, "cannot be read");
  check_error([&] { write_state(state, model.structure, folder.path / "no such folder" / "state.petsc"); },
              "No such file or directory");

  write_state(state_of(model.structure, {1, std::nan(""), 3}, {4, 5, 6}), model.structure, file);
  check_error(read, "not finite");
}

TEST_CASE("a step size or theta without meaning is an error")
{
  const auto model = test::unilateral_oscillator(0.3, 0.6);
  check_error([&] { (void)make_theta_step(model.structure, model.interface, 0, 0.5, {}); }, "time step");
  check_error([&] { (void)make_theta_step(model.structure, model.interface, std::nan(""), 0.5, {}); }, "time step");
  check_error([&] { (void)make_theta_step(model.structure, model.interface, 0.1, 0, {}); }, "theta");
  check_error([&] { (void)make_theta_step(model.structure, model.interface, 0.1, 1.5, {}); }, "theta");
}

TEST_CASE(
    "the discrete eigenvalue loses (omega h)^2/4 of the growth and (omega h)^2/12 of the frequency at theta = 1/2")
{
  const std::complex<double> lambda(1e-3, 1);
  const double h = 0.01;
  const auto discrete = discrete_eigenvalue(lambda, 0.5, h);
  // next terms: (omega h)^4 = 1e-8 of the value
  CHECK(discrete.real() / lambda.real() - 1 == approx(-h * h / 4, 1e-3));
  CHECK(discrete.imag() / lambda.imag() - 1 == approx(-h * h / 12, 1e-3));
  CHECK(discrete_eigenvalue(lambda, 0.51, h).real() == approx(1e-3 - 0.01 * h, 1e-3));
}

TEST_CASE("in free flight every theta follows its discrete eigenvalue exactly")
{
  // two masses far above the ground, joined by a spring: relative motion at omega = 2 with damping
  for (const double theta : {0.5, 0.6, 1.})
  {
    auto model = test::mass_spring_chain(2, 2, 2, 100, 0); // end masses of 1 kg
    check(MatAXPY(model.structure.C, 0.05, model.structure.K, SAME_NONZERO_PATTERN));
    const double h = 0.1;
    const std::complex<double> lambda(-0.1, std::sqrt(4 - 0.01)); // lambda^2 + 0.05 * 4 lambda + 4 = 0
    const std::complex<double> end = std::exp(discrete_eigenvalue(lambda, theta, h) * 7. * h);
    State state = state_of(model.structure, {1, -1}, {lambda.real(), -lambda.real()});
    const ThetaStep step = make_theta_step(model.structure, model.interface, h, theta, {});
    CHECK(test::run_steps(model, step, 7, state) == 0);
    CHECK(all_entries(state.u)[0] == approx(end.real(), 1e-13));
    CHECK(all_entries(state.v)[1] == approx(-(lambda * end).real(), 1e-13));
  }
}

TEST_CASE("a trajectory is the same by every kind of factor, through contact and free flight")
{
  const auto model = test::unilateral_oscillator(0.3, 0.6);
  const auto end = [&](const char* kind)
  {
    const test::Option factor("-factor", kind);
    const ThetaStep step = make_theta_step(model.structure, model.interface, 0.015, 0.5, {});
    State state = state_of(model.structure, {3, -0.5, -0.5}, {0, 3, 0});
    CHECK(test::run_steps(model, step, 500, state) == 0);
    return std::pair(all_entries(state.u), all_entries(state.v));
  };
  const auto [u, v] = end("automatic");
  for (const char* kind : {"supernodal", "mumps"})
  {
    const auto [other_u, other_v] = end(kind);
    for (std::size_t i = 0; i < u.size(); ++i)
    {
      CHECK(std::abs(other_u[i] - u[i]) < 1e-10); // motions of order one; contact is solved to 1e-10
      CHECK(std::abs(other_v[i] - v[i]) < 1e-10);
    }
  }
}

TEST_CASE("status of pairs: open without reaction, stick inside the Coulomb disc, slip on its rim")
{
  Interface interface;
  interface.pairs = 3;
  interface.directions = 2;
  interface.friction.common.coefficient = 0.5;
  const auto status = contact_status(interface, {0, 0, 0, 10, 3, -4, 10, 3, 3.9}, std::vector<double>{});
  CHECK(status == std::vector<ContactStatus>{ContactStatus::open, ContactStatus::slip, ContactStatus::stick});
}
