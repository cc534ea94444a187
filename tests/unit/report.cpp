// ranks: 1 2 3
#include "squeal/report/report.hpp"
#include "../support/temporary_folder.hpp"
#include "squeal/model.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <doctest/doctest.h>
#include <fstream>
#include <hdf5.h>
#include <limits>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>

using namespace squeal;
using test::TemporaryFolder;
namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace
{

std::string text_of(const fs::path& file)
{
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

const std::vector<Vec3> cube = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
using Edges = std::vector<std::pair<int, int>>;
// Mid-side nodes of gmsh 4 (its reference manual, "Node ordering") and of VTK (its file formats).
const Edges gmsh_hex = {{0, 1}, {0, 3}, {0, 4}, {1, 2}, {1, 5}, {2, 3}, {2, 6}, {3, 7}, {4, 5}, {4, 7}, {5, 6}, {6, 7}};
const Edges vtk_hex = {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {4, 5}, {5, 6}, {6, 7}, {7, 4}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
const Edges gmsh_tet = {{0, 1}, {1, 2}, {2, 0}, {3, 0}, {2, 3}, {1, 3}};
const Edges vtk_tet = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};

/// One element of its own nodes: corners, then the middles of its edges.
void add_element(Mesh& mesh, Shape shape, const std::vector<Vec3>& corners, const Edges& edges, double shift)
{
  Element element{shape, 0, {}};
  std::vector<Vec3> nodes = corners;
  for (const auto& [a, b] : edges)
  {
    const Vec3 &p = corners[static_cast<std::size_t>(a)], &q = corners[static_cast<std::size_t>(b)];
    nodes.push_back({(p[0] + q[0]) / 2, (p[1] + q[1]) / 2, (p[2] + q[2]) / 2});
  }
  for (std::size_t k = 0; k < nodes.size(); ++k)
  {
    element.nodes[k] = static_cast<int>(mesh.nodes.size());
    mesh.nodes.push_back({nodes[k][0] + shift, nodes[k][1], nodes[k][2]});
  }
  mesh.elements.push_back(element);
}

/// One element of every shape and a point; three free degrees of freedom a node.
Model one_of_each()
{
  Model model;
  Mesh& mesh = model.mesh;
  add_element(mesh, Shape::hex20, cube, gmsh_hex, 0);
  add_element(mesh, Shape::tet10, {cube[0], cube[1], cube[3], cube[4]}, gmsh_tet, 2);
  add_element(mesh, Shape::hex8, cube, {}, 4);
  add_element(mesh, Shape::wedge6, {cube[0], cube[1], cube[3], cube[4], cube[5], cube[7]}, {}, 6);
  add_element(mesh, Shape::quad4, {cube[0], cube[1], cube[2], cube[3]}, {}, 8);
  add_element(mesh, Shape::triangle3, {cube[0], cube[1], cube[2]}, {}, 10);
  mesh.points["tip"] = static_cast<int>(mesh.nodes.size());
  mesh.nodes.push_back({12, 0, 0});
  DofMap& dofs = model.dofs;
  for (std::size_t node = 0; node < mesh.nodes.size(); ++node)
    for (int component = 0; component < 6; ++component)
    {
      dofs.offsets.push_back(static_cast<PetscInt>(dofs.terms.size()));
      if (component < 3) dofs.terms.push_back({dofs.size++, 1});
    }
  dofs.offsets.push_back(static_cast<PetscInt>(dofs.terms.size()));
  check(VecCreateMPI(PETSC_COMM_WORLD, PETSC_DECIDE, dofs.size, model.structure.load.put()));
  check(VecSet(model.structure.load, 0));
  return model;
}

/// u[dof] = scale * dof, which tells every entry apart.
Owned<Vec> ramp(const Model& model, double scale)
{
  Owned<Vec> u = zeros_like(model.structure.load);
  PetscInt first = 0, last = 0;
  check(VecGetOwnershipRange(u, &first, &last));
  for (PetscInt i = first; i < last; ++i) check(VecSetValue(u, i, scale * static_cast<double>(i), INSERT_VALUES));
  check(VecAssemblyBegin(u));
  check(VecAssemblyEnd(u));
  return u;
}

History history_of(std::size_t steps)
{
  History history;
  for (auto* series : {&history.time, &history.energy, &history.fluctuating_energy, &history.damping_power,
                       &history.contact_power, &history.load_power, &history.normal_force})
    series->assign(steps, 0.5);
  for (auto* counts : {&history.open, &history.stick, &history.slip}) counts->assign(steps, 1);
  history.probes = {std::vector<double>(steps, 0.25)};
  return history;
}

/// Every stage ran.
Report full_report(const Model& model)
{
  Report report;
  report.model.dofs = model.dofs.size;
  report.model.pairs = 2;
  report.model.elements = static_cast<long>(model.mesh.elements.size());
  report.point.equilibrium.outcome = {OutcomeKind::converged, "", 3, 1e-12};
  report.point.equilibrium.u = ramp(model, 1);
  report.point.equilibrium.reactions = {3, 0.6, 0, 0, 0, 0, 7, 1.4, 0};
  report.point.equilibrium.closed = {1, 0, 1};
  report.point.modes.outcome = {OutcomeKind::converged, "", 1, 1e-13};
  report.point.modes.method = ModesMethod::full;
  ComplexMode mode;
  mode.lambda = {5, 2 * std::acos(-1.) * 100};
  mode.real = ramp(model, 2);
  mode.imaginary = ramp(model, 3);
  report.point.modes.modes.push_back(std::move(mode));
  report.point.modes.unstable_count = 1;
  report.point.estimates.emplace_back().outcome = {OutcomeKind::no_balance, "the curve has no root", 0, 0};
  report.transient.outcome = {OutcomeKind::completed, "", 10, 1e-11};
  report.transient.growth_rate_fit = std::numeric_limits<double>::quiet_NaN();
  report.transient.history = history_of(11);
  report.motion.cycle.outcome = {OutcomeKind::converged, "", 4, 1e-6};
  report.motion.cycle.orbit.period = 0.01;
  report.motion.cycle.steps_per_period = 5;
  report.motion.cycle.measured.history = history_of(5);
  report.motion.cycle.measured.peak_to_peak = {1e-6};
  report.motion.cycle.measured.statuses = {{ContactStatus::open, ContactStatus::slip},
                                           {ContactStatus::stick, ContactStatus::slip}};
  for (int i = 0; i < 4; ++i) report.motion.cycle.measured.displacements.push_back(ramp(model, i));
  report.timings = {{Stage::modes, 1.5, 1.25}};
  return report;
}

Scene scene_of_test()
{
  Scene scene;
  scene.title = "one of each";
  scene.probes.push_back({"tip x", "tip", {}, {1, 0, 0}});
  return scene;
}

/// A data set as doubles, with its shape.
std::vector<double> read_set(hid_t file, const std::string& name, std::vector<hsize_t>& shape)
{
  const hid_t set = H5Dopen2(file, name.c_str(), H5P_DEFAULT);
  REQUIRE_MESSAGE(set >= 0, name);
  const hid_t space = H5Dget_space(set);
  shape.resize(static_cast<std::size_t>(H5Sget_simple_extent_ndims(space)));
  H5Sget_simple_extent_dims(space, shape.data(), nullptr);
  std::vector<double> data(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)));
  H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, data.data());
  H5Sclose(space);
  H5Dclose(set);
  return data;
}

/// The middles of the element that stands at `at` in the topology are those of VTK's edges.
void check_middles(const std::vector<double>& topology, std::size_t at, const Edges& edges, std::size_t corners,
                   const std::vector<double>& x)
{
  const auto coordinate = [&](std::size_t node, std::size_t k)
  { return x[3 * static_cast<std::size_t>(topology[at + 1 + node]) + k]; };
  for (std::size_t e = 0; e < edges.size(); ++e)
    for (std::size_t k = 0; k < 3; ++k)
      CHECK(coordinate(corners + e, k) == (coordinate(static_cast<std::size_t>(edges[e].first), k) +
                                           coordinate(static_cast<std::size_t>(edges[e].second), k)) /
                                              2);
}

} // namespace

TEST_CASE("fields: every set the XDMF names is in the file with that shape, and nodes follow VTK's order")
{
  const TemporaryFolder folder;
  const Model model = one_of_each();
  write_results(full_report(model), scene_of_test(), model, folder.path, PETSC_COMM_WORLD);
  if (rank_of(PETSC_COMM_WORLD) != 0) return;

  const std::string xdmf = text_of(folder.path / "fields.xdmf");
  const hid_t file = H5Fopen((folder.path / "fields.h5").c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  REQUIRE(file >= 0);
  const std::regex item("Dimensions=\"([0-9 ]+)\"[^>]*>fields.h5:/([^<]+)<");
  std::vector<hsize_t> shape;
  int items = 0;
  for (std::sregex_iterator match(xdmf.begin(), xdmf.end(), item), end; match != end; ++match, ++items)
  {
    read_set(file, (*match)[2], shape);
    std::ostringstream text;
    for (const hsize_t size : shape) text << (size == shape.front() && text.str().empty() ? "" : " ") << size;
    CHECK(text.str() == (*match)[1].str());
  }
  // Four samples of topology, nodes, part, equilibrium, mode (two parts), cycle.
  CHECK(items == 4 * 7);

  const auto topology = read_set(file, "mesh/topology", shape), x = read_set(file, "mesh/nodes", shape);
  check_middles(topology, 0, vtk_hex, 8, x);
  check_middles(topology, 21, vtk_tet, 4, x);
  // Dof i is component i % 3 of node i / 3, so the nodal field is the ramp itself: exact.
  const auto sample = read_set(file, "cycle/displacement_2", shape);
  CHECK(shape == std::vector<hsize_t>{model.mesh.nodes.size(), 3});
  for (std::size_t i = 0; i < sample.size(); ++i) CHECK(sample[i] == 2. * static_cast<double>(i));
  H5Fclose(file);
}

TEST_CASE("history: one entry a step, statuses as step by pair")
{
  const TemporaryFolder folder;
  const Model model = one_of_each();
  write_results(full_report(model), scene_of_test(), model, folder.path, PETSC_COMM_WORLD);
  if (rank_of(PETSC_COMM_WORLD) != 0) return;
  const hid_t file = H5Fopen((folder.path / "history.h5").c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  std::vector<hsize_t> shape;
  CHECK(read_set(file, "transient/energy", shape).size() == 11);
  CHECK(read_set(file, "cycle/probes/tip x", shape) == std::vector<double>(5, 0.25));
  CHECK(read_set(file, "cycle/status", shape) == std::vector<double>{0, 2, 1, 2});
  CHECK(shape == std::vector<hsize_t>{2, 2});
  H5Fclose(file);
}

TEST_CASE("report.json has the documented keys; what is not a number is null; a skipped stage has its reason")
{
  const Model model = one_of_each();
  Report report = full_report(model);
  const Json json = Json::parse(report_json(report, scene_of_test()));
  CHECK(json["equilibrium"]["closed"] == 2);
  CHECK(json["equilibrium"]["normal_force_sum"] == 10);
  CHECK(json["equilibrium"]["normal_force_min"] == 3);
  CHECK(json["equilibrium"]["normal_force_max"] == 7);
  CHECK(json["modes"]["modes"][0]["growth_rate"] == 5);
  CHECK(json["estimate"]["outcome"] == "no balance");
  CHECK(json["estimate"]["amplitude"].is_null()); // never a number that is not a root
  CHECK(json["transient"]["growth_rate_fit"].is_null());
  CHECK(json["cycle"]["peak_to_peak"]["tip x"] == 1e-6);
  CHECK(json["timings"]["modes"] == 1.5);
  CHECK(json["processor_seconds"]["modes"] == 1.25);
  const std::vector<std::pair<std::string, std::vector<std::string>>> documented = {
      {"model", {"dofs", "pairs", "elements", "ranks"}},
      {"equilibrium",
       {"outcome", "iterations", "closed", "normal_force_sum", "normal_force_min", "normal_force_max", "residual"}},
      {"modes", {"outcome", "method", "unstable_count", "modes"}},
      {"estimate",
       {"outcome", "amplitude", "lift_off_amplitude", "reversal_amplitude", "damping_rate", "friction_rate_linear"}},
      {"transient",
       {"outcome", "theta", "steps", "step_size", "periods", "growth_rate_fit", "growth_rate_predicted",
        "energy_defect_max"}},
      {"cycle",
       {"outcome", "period", "frequency_hz", "steps_per_period", "residual_projected", "residual_full",
        "newton_iterations", "periods_integrated", "mean_energy", "mean_fluctuating_energy", "open_pairs_mean",
        "open_pairs_max", "stick_pairs_max", "peak_to_peak"}}};
  for (const auto& [stage, keys] : documented)
    for (const auto& key : keys) CHECK_MESSAGE(json[stage].contains(key), stage, ".", key);

  report.motion.cycle.outcome = {OutcomeKind::skipped, "no mode is unstable", 0, 0};
  const Json skipped = Json::parse(report_json(report, scene_of_test()));
  CHECK(skipped["cycle"] == Json{{"outcome", "skipped"}, {"reason", "no mode is unstable"}});
}

TEST_CASE("the table never shows figures of a cycle that did not converge")
{
  const Model model = one_of_each();
  Report report = full_report(model);
  CHECK(table(report, scene_of_test(), TableLength::full).find("mean energy") != std::string::npos);
  report.motion.cycle.outcome = {OutcomeKind::not_converged, "the residual stalled", 9, 0.1};
  const std::string text = table(report, scene_of_test(), TableLength::full);
  CHECK(text.find("mean energy") == std::string::npos);
  CHECK(text.find("NOT CONVERGED: the residual stalled") != std::string::npos);
}

TEST_CASE("a mode that grows without contact is told, and not the lack of contact")
{
  const Model model = one_of_each();
  Report report = full_report(model);
  report.motion.cycle.outcome = report.motion.settled.outcome = {OutcomeKind::off, "", 0, 0};
  report.model.pairs = 0;
  std::ranges::fill(report.point.equilibrium.closed, 0);
  CHECK(heard(report, scene_of_test()) == "the equilibrium is unstable at 100 Hz");
  report.point.modes.unstable_count = 0;
  CHECK(heard(report, scene_of_test()).starts_with("no contact"));
}

TEST_CASE(
    "the short table: an answer, a row a stage, what failed, the next command; a known motion settles the estimate")
{
  const Model model = one_of_each();
  Report report = full_report(model);
  report.program = "squeal";
  report.command = "squeal scene";
  report.place = "results/scene";
  report.model.warnings = {"first", "second"};
  report.motion.cycle.multipliers.stability = Stability::stable;
  const auto has = [](const std::string& text, const char* words) { return text.find(words) != std::string::npos; };
  const std::string found = table(report, scene_of_test(), TableLength::brief);
  CHECK(std::ranges::count(found, '\n') <= 20);
  CHECK(found.starts_with("\none of each\n  heard        squeals at 100 Hz"));
  CHECK(has(found, "\n  cycle        converged, frequency 100 Hz"));
  CHECK(has(found, "\n    modes      frequency 100 Hz, growth rate 5 1/s"));
  CHECK(has(found, "\n  WARNING: first\n  WARNING: second\n"));
  CHECK(has(found, "\n  next         squeal report results/scene\n"));
  CHECK_FALSE(has(found, "FAILED"));
  report.motion.cycle.outcome = {OutcomeKind::not_converged, "the residual stalled", 9, 0.1};
  report.transient.energy_defect_max = 0.5;
  const std::string failed = table(report, scene_of_test(), TableLength::brief);
  CHECK(has(failed, "NOT CONVERGED: the residual stalled"));
  CHECK(has(failed, "FAILED: transient energy defect max 0.5"));
  CHECK(has(failed, "next         squeal scene --set transient.periods=400"));
  CHECK_FALSE(has(found, "no amplitude is predicted"));
}

TEST_CASE("the residual of a cycle fails no check below its tolerance, or where a settled motion is the answer")
{
  const Model model = one_of_each();
  Report report = full_report(model);
  report.program = "squeal";
  report.command = "squeal scene";
  report.motion.cycle.tolerance = 1e-5;
  report.motion.cycle.outcome.kind = OutcomeKind::unstable_cycle;
  report.motion.cycle.multipliers.stability = Stability::undecided;
  const auto says = [&](const char* words)
  { return table(report, scene_of_test(), TableLength::brief).find(words) != std::string::npos; };
  report.motion.cycle.orbit.residual = 3.6e-6;
  CHECK_FALSE(says("FAILED"));
  report.motion.cycle.orbit.residual = 3.6e-5;
  CHECK(says("FAILED: cycle residual full 3.6e-05"));
  report.motion.cycle.outcome.kind = report.motion.settled.outcome.kind = OutcomeKind::settled;
  CHECK_FALSE(says("FAILED"));
  CHECK_FALSE(says("-cycle_watched_periods")); // the motion is known
  CHECK(says("next         squeal report"));
}

TEST_CASE("a track counts points, also where several modes of a design point have its name; every number has a name")
{
  const Model model = one_of_each();
  Report report = full_report(model);
  Scene scene = scene_of_test();
  scene.numbers["load"] = 100;
  scene.sweep.emplace().key = {"numbers.load", "friction.coefficient"};
  report.sweep.outcome.kind = OutcomeKind::converged;
  for (const double growth : {5., -1.})
    report.sweep.points.push_back(
        {{{100, 0.3}, false},
         false,
         {OutcomeKind::converged, "", 0, 0},
         0,
         0,
         {{.lambda = {growth, 600}, .track = 0, .mac = 0.9}, {.lambda = {-2, 700}, .track = 0, .mac = 0.1}}});
  const Json sweep = Json::parse(report_json(report, scene))["sweep"];
  CHECK(sweep["unstable_tracks"][0]["points"] == 2);
  CHECK(sweep["unstable_tracks"][0]["unstable_points"] == 1);
  CHECK(sweep["names"] == Json{"numbers.load", "friction.coefficient"});
}

TEST_CASE("a folder that cannot be written is an error on every rank, and nothing is left half-written")
{
  const TemporaryFolder folder;
  const Model model = one_of_each();
  folder.write("taken", "a file where the folder should be");
  CHECK_THROWS_AS(write_results(full_report(model), scene_of_test(), model, folder.path / "taken", PETSC_COMM_WORLD),
                  Error);
  // A folder in the place of a result file: the file's move fails, its draft must go.
  on_rank_zero(PETSC_COMM_WORLD, [&] { fs::create_directories(folder.path / "out" / "history.h5" / "full"); });
  CHECK_THROWS_AS(write_results(full_report(model), scene_of_test(), model, folder.path / "out", PETSC_COMM_WORLD),
                  Error);
  if (rank_of(PETSC_COMM_WORLD) != 0) return;
  CHECK_FALSE(fs::exists(folder.path / "out" / "history.h5.part"));
  CHECK_FALSE(fs::exists(folder.path / "out" / "report.json"));
}

TEST_CASE("a matrix scene has no mesh to draw and writes no fields")
{
  const TemporaryFolder folder;
  const Model model = one_of_each();
  Scene scene = scene_of_test();
  scene.matrices = folder.path;
  write_results(full_report(model), scene, model, folder.path, PETSC_COMM_WORLD);
  CHECK_FALSE(fs::exists(folder.path / "fields.h5"));
  CHECK(fs::exists(folder.path / "report.json"));
}
