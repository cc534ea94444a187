// ranks: 1
#include "squeal/scene/scene.hpp"
#include "../support/temporary_folder.hpp"
#include "squeal/scene/numbers.hpp"

#include <array>
#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;
using test::TemporaryFolder;
namespace fs = std::filesystem;

namespace
{

const std::string brake = R"(title = "a \"small\" brake"
[mesh]
file = "brake.geo"
scale = 1e-3
parameters = { size = 4000, "pin height" = 0.04 }
[[part]]
name = "disc"
young = 210e9
poisson = 0.3
density = 7800
[[part]]
name = "hub"
young = 2.1e11
poisson = 0.3
density = 7800
thickness = 0.008
beta = 1e-7
[[point]]
name = "eye"
at = [0.1, 0, 0]
mass = 0.25
free = "x rz"
[[rigid_body]]
name = "carrier"
surfaces = "backs"
at = [0, 0, 0.1]
mass = 5
inertia = [1, 2, 3]
free = "z"
[[spring]]
from = "carrier"
direction = [0, 0, -2]
stiffness = 1e6
damping = 3
[[support]]
on = "bore"
fixed = "all"
[[force]]
on = "carrier"
vector = [0, 0, -500]
[[pressure]]
on = "backs"
value = 1e5
[[contact]]
rotor = "disc_top"
stator = "pins"
gap = -0.1
tangents = ["x", [0, 1, 0]]
rotation = { axis = "z", rate = 20 }
[friction]
coefficient = 0.2
direction_damping = false
[damping]
alpha = 1
beta = 1.1e-6
[modes]
method = "full"
band = 5000
[transient]
start = "state.bin"
steps = 10
step_size = 1e-6
[cycle]
tolerance = 1e-8
save_state = "out/cycle.bin"
[[probe]]
name = "rim"
on = "disc"
at = [0.3, 0, 0]
direction = "-y"
)";

const std::string points = R"([[point]]
name = "disc"
at = [0, 0, 0]
mass = 0.5
free = "y"
[[point]]
name = "pad"
at = [0, 0, 0]
mass = 1
free = "x y"
[[contact]]
rotor = "disc"
stator = "pad"
normal = "y"
velocity = [1, 0, 0]
[friction]
coefficient = 0.3
)";

/// The text of the error that reading `text` gives; empty if it is read.
std::string error_of(const std::string& text, const std::vector<std::string>& overrides)
{
  const TemporaryFolder folder;
  folder.write("brake.geo", "");
  folder.write("state.bin", "");
  fs::create_directory(folder.path / "matrices");
  try
  {
    read_scene(folder.write("scene.toml", text), overrides);
  }
  catch (const Error& error)
  {
    return error.what();
  }
  return "";
}

std::string replaced(std::string text, const std::string& from, const std::string& to)
{
  const auto at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

/// Every piece stands in the message, which is one line.
void check_message(const std::string& message, const std::vector<std::string>& pieces)
{
  CAPTURE(message);
  CHECK(message.find('\n') == std::string::npos);
  for (const auto& piece : pieces)
  {
    CAPTURE(piece);
    CHECK(message.find(piece) != std::string::npos);
  }
}

} // namespace

TEST_CASE("every key reaches its member, in SI units, with unit directions and absolute paths")
{
  const TemporaryFolder folder;
  folder.write("brake.geo", "");
  folder.write("state.bin", "");
  const Scene s = read_scene(folder.write("scene.toml", brake), {});
  CHECK(s.title == "a \"small\" brake");
  CHECK(s.file == folder.path / "scene.toml");
  CHECK(s.mesh->file == folder.path / "brake.geo");
  CHECK(s.mesh->scale == 1e-3);
  CHECK(s.mesh->parameters == std::map<std::string, double>{{"size", 4000}, {"pin height", 0.04}});
  REQUIRE(s.parts.size() == 2);
  CHECK(s.parts[0].material.young == 210e9);
  CHECK_FALSE(s.parts[0].damping);
  CHECK(s.parts[1].thickness == 0.008);
  CHECK(s.parts[1].damping->beta == 1e-7);
  CHECK(s.parts[1].damping->alpha == 0);
  CHECK(s.points[0].free == Motions{true, false, false, false, false, true});
  CHECK(s.rigid_bodies[0].surfaces == std::vector<std::string>{"backs"});
  CHECK(s.rigid_bodies[0].inertia == std::array<double, 6>{1, 2, 3, 0, 0, 0});
  CHECK(s.springs[0].to == "ground");
  CHECK(s.springs[0].direction == Vec3{0, 0, -1});
  CHECK(s.springs[0].damping == 3);
  CHECK(s.supports[0].fixed == Motions{true, true, true, true, true, true});
  CHECK(s.forces[0].vector == Vec3{0, 0, -500});
  CHECK(s.pressures[0].value == 1e5);
  CHECK(s.contacts[0].gap == -0.1);
  CHECK(s.contacts[0].tangents == std::vector<Vec3>{{1, 0, 0}, {0, 1, 0}});
  CHECK(s.contacts[0].rotation->rate == 20);
  CHECK(s.contacts[0].rotation->axis == Vec3{0, 0, 1});
  CHECK(s.friction.coefficient == 0.2);
  CHECK_FALSE(s.friction.direction_damping);
  CHECK(s.damping.beta == 1.1e-6);
  CHECK(s.modes.method == ModesMethod::full);
  CHECK(s.modes.enabled);
  CHECK(s.transient.enabled);
  CHECK(s.transient.start.kind == StartKind::file);
  CHECK(s.transient.start.file == folder.path / "state.bin");
  CHECK(s.transient.steps == 10);
  CHECK(s.cycle.enabled);
  CHECK(s.cycle.tolerance == 1e-8);
  CHECK(s.cycle.save_state == folder.path / "out/cycle.bin");
  CHECK(s.probes[0].direction == Vec3{0, -1, 0});
  CHECK(s.probes[0].at == Vec3{0.3, 0, 0});
}

TEST_CASE("the resolved text of a scene reads back as the same scene")
{
  const TemporaryFolder folder, elsewhere; // paths are absolute, so the resolved scene may lie anywhere
  folder.write("brake.geo", "");
  folder.write("state.bin", "");
  fs::create_directory(folder.path / "matrices");
  const std::string matrix = "[matrices]\nfolder = \"matrices\"\n[[probe]]\nname = \"p\"\non = \"dof:3\"\n";
  for (const std::string& text : {brake, points, matrix})
  {
    const std::string once = resolved_scene(read_scene(folder.write("scene.toml", text), {"modes.band=7000"}));
    const Scene again = read_scene(elsewhere.write("scene.toml", once), {});
    CHECK(resolved_scene(again) == once);
    CHECK(again.modes.band == 7000);
  }
}

TEST_CASE("a title of any characters comes through --set and the resolved text")
{
  const TemporaryFolder folder;
  const std::string title = "C:\\tmp \"squeal\",\ta second\nline at 20 °C";
  const Scene scene = read_scene(folder.write("a.toml", points), {"title=" + title});
  CHECK(scene.title == title);
  CHECK(read_scene(folder.write("b.toml", resolved_scene(scene)), {}).title == title);
}

TEST_CASE("stages after the estimate run when their table is there, unless it says otherwise")
{
  const TemporaryFolder folder;
  const Scene plain = read_scene(folder.write("a.toml", points), {});
  CHECK(plain.modes.enabled);
  CHECK(plain.estimate.enabled);
  CHECK_FALSE(plain.transient.enabled);
  CHECK_FALSE(plain.cycle.enabled);
  const Scene off = read_scene(folder.write("b.toml", points + "[transient]\nenabled = false\n[cycle]\n"), {});
  CHECK_FALSE(off.transient.enabled);
  CHECK(off.cycle.enabled);
}

TEST_CASE("an override reaches any key: by table, by name in a list, by index, as a bare word")
{
  const TemporaryFolder folder;
  folder.write("brake.geo", "");
  folder.write("state.bin", "");
  const Scene s = read_scene(folder.write("scene.toml", brake),
                             {"friction.coefficient=0.25", "part.disc.density=7000", "contact.0.gap=1e-6",
                              "mesh.parameters.size=32000", "transient.start=mode", "contact.0.tangents=[[1,0,0]]",
                              "contact.0.rotation.rate=-3", "title=\"quoted\"", "part.hub.thickness = 0.01"});
  CHECK(s.friction.coefficient == 0.25);
  CHECK(s.parts[0].material.density == 7000);
  CHECK(s.parts[1].thickness == 0.01);
  CHECK(s.contacts[0].gap == 1e-6);
  CHECK(s.contacts[0].tangents.size() == 1);
  CHECK(s.contacts[0].rotation->rate == -3);
  CHECK(s.mesh->parameters.at("size") == 32000);
  CHECK(s.mesh->parameters.at("pin height") == 0.04);
  CHECK(s.transient.start.kind == StartKind::mode);
  CHECK(s.title == "quoted");
}

TEST_CASE("a wrong override says which one and what is near")
{
  check_message(error_of(points, {"friction.coeficient=0.3"}),
                {"--set friction.coeficient=0.3", "unknown key 'coeficient'", "did you mean 'coefficient'"});
  check_message(error_of(points, {"fricton.coefficient=0.3"}), {"--set", "'fricton'", "'friction'"});
  check_message(error_of(points, {"point.dics.mass=1"}), {"--set", "'dics'", "'disc'"});
  check_message(error_of(points, {"contact.1.gap=0"}), {"--set", "contact has no entry '1'"});
  check_message(error_of(points, {"friction.coefficient"}), {"--set", "KEY=VALUE"});
  check_message(error_of(points, {"a..b=1"}), {"--set", "KEY"});
  check_message(error_of(points, {"friction.coefficient=much"}), {"--set", "much", "not text"});
  check_message(error_of(points, {"friction.coefficient=nan"}), {"--set", "coefficient = nan"});
  check_message(error_of(points, {"point=3"}), {"--set point=3", "[[point]]"});
}

TEST_CASE("a syntax error gives file, line and column")
{
  check_message(error_of("title = \"a\"\n[mesh\n", {}), {"scene.toml", "line 2", "column"});
  CHECK_THROWS_WITH_AS(read_scene("/no/such.toml", {}), "there is no scene file /no/such.toml", Error);
}

TEST_CASE("an unknown key gives file, line, table and the nearest key")
{
  check_message(error_of(replaced(brake, "density = 7800", "densty = 7800"), {}),
                {"scene.toml, line 10", "[[part]] disc", "'densty'", "did you mean 'density'"});
  check_message(error_of(replaced(brake, "axis = \"z\"", "axes = \"z\""), {}), {"rotation", "'axes'", "'axis'"});
  check_message(error_of("fooooooooooooo = 1\n" + points, {}),
                {"line 1", "known: title, fidelity, accuracy, gravity, numbers, mesh"});
}

TEST_CASE("wrong types, signs and ranges are refused with key, value and what is expected")
{
  const std::vector<std::array<std::string, 3>> cases = {
      {"density = 7800", "density = -7800", "density = -7800"},
      {"density = 7800", "density = 0", "positive"},
      {"density = 7800", "density = \"heavy\"", "not text"},
      {"young = 210e9", "young = inf", "young = inf"},
      {"poisson = 0.3", "poisson = 0.5", "below 0.5"},
      {"poisson = 0.3", "poisson = -1", "above -1"},
      {"thickness = 0.008", "thickness = -1", "thickness"},
      {"coefficient = 0.2", "coefficient = nan", "coefficient = nan"},
      {"coefficient = 0.2", "coefficient = -0.1", "zero or a positive number"},
      {"direction_damping = false", "direction_damping = 0", "true or false"},
      {"scale = 1e-3", "scale = 0", "scale = 0"},
      {"steps = 10", "steps = 10.5", "a whole number"},
      {"steps = 10", "steps = -1", "steps = -1"},
      {"method = \"full\"", "method = \"fulll\"", "did you mean 'full'"},
      {"tolerance = 1e-8", "tolerance = -1e-8", "zero or a positive number"},
      {"tolerance = 1e-8", "theta = 1.5", "at most 1"},
      {"direction = [0, 0, -2]", "direction = [0, 0, 0]", "zero vector"},
      {"direction = [0, 0, -2]", "direction = \"w\"", "x, y, z"},
      {"vector = [0, 0, -500]", "vector = [0, -500]", "three numbers"},
      {"vector = [0, 0, -500]", "vector = [0, 0, nan]", "finite"},
      {"free = \"z\"", "free = \"q\"", "x y z rx ry rz"},
      {"inertia = [1, 2, 3]", "inertia = [1, 2]", "three or six"},
      {"inertia = [1, 2, 3]", "inertia = [1, -2, 3]", "negative"},
      {"surfaces = \"backs\"", "surfaces = []", "at least one"},
      {"name = \"hub\"", "name = \"\"", "not empty"},
      {"size = 4000", "size = \"big\"", "finite numbers"},
      {"tangents = [\"x\", [0, 1, 0]]", "tangents = [\"x\", \"y\", \"z\"]", "one or two"},
      {"band = 5000", "band = -1", "band = -1"},
      {"[friction]", "[[friction]]", "is a table"},
      {"start = \"state.bin\"", "start = \"stat.bin\"", "there is no file"},
      {"file = \"brake.geo\"", "file = \"brek.geo\"", "there is no file"},
  };
  for (const auto& [from, to, expected] : cases)
    check_message(error_of(replaced(brake, from, to), {}), {"scene.toml, line ", expected});
  CHECK(error_of(brake, {}).empty()); // each case fails for its one change alone
}

TEST_CASE("a missing key is named with its unit")
{
  check_message(error_of(replaced(brake, "density = 7800\n", ""), {}),
                {"line 6", "[[part]] disc", "'density' [kg/m3]"});
  check_message(error_of(replaced(points, "mass = 0.5\nfree = \"y\"\n", ""), {}), {"[[point]] disc", "'free'"});
}

TEST_CASE("a scene has one structure: a mesh, matrices or points")
{
  check_message(error_of("title = \"empty\"\n", {}), {"scene.toml", "[mesh], [matrices] or [[point]]"});
  check_message(error_of(brake + "[matrices]\nfolder = \"matrices\"\n", {}), {"exclude each other"});
  check_message(error_of("[matrices]\nfolder = \"none\"\n", {}), {"line 2", "there is no folder"});
  check_message(error_of("[matrices]\nfolder = \"matrices\"\n" + points, {}), {"[[point]]", "matrix scene"});
  const std::string matrices = "[matrices]\nfolder = \"matrices\"\n";
  check_message(error_of(matrices + "[[support]]\non = \"bore\"\nfixed = \"all\"\n", {}), {"bore", "node:N"});
  check_message(error_of(matrices + "[[support]]\non = \"dof:1\"\nfixed = \"x\"\n", {}), {"dof:1", "fixed = \"all\""});
  check_message(error_of(matrices + "[[force]]\non = \"dof:1\"\nvector = [0, 1, 0]\n", {}), {"[value, 0, 0]"});
  check_message(error_of(matrices + "[[probe]]\nname = \"p\"\non = \"node:1-2\"\n", {}), {"one row or node"});
  check_message(error_of("[mesh]\nfile = \"brake.geo\"\n", {}), {"[[part]]"});
  check_message(error_of(points + "[[pressure]]\non = \"a\"\nvalue = 1\n", {}), {"[[pressure]]", "[mesh]"});
}

TEST_CASE("names that are doubled or not defined are refused")
{
  check_message(error_of(replaced(brake, "name = \"hub\"", "name = \"disc\""), {}), {"[[part]]", "\"disc\"", "taken"});
  check_message(error_of(replaced(brake, "name = \"eye\"", "name = \"ground\""), {}), {"\"ground\"", "taken"});
  check_message(error_of(replaced(brake, "name = \"eye\"", "name = \"carrier\""), {}), {"\"carrier\"", "taken"});
  check_message(error_of(replaced(brake, "from = \"carrier\"", "from = \"ground\""), {}), {"both"});
  check_message(error_of(replaced(points, "rotor = \"disc\"", "rotor = \"disk\""), {}), {"rotor", "'disc'"});
  check_message(error_of(points + "[[probe]]\nname = \"p\"\non = \"pda\"\ndirection = \"x\"\n", {}), {"'pad'"});
  check_message(error_of(points + "[[force]]\non = \"pda\"\nvector = [0, 1, 0]\n", {}), {"[[force]]", "'pad'"});
}

TEST_CASE("contradictions between keys are refused")
{
  check_message(error_of(replaced(points, "normal = \"y\"\n", ""), {}), {"'normal'"});
  check_message(error_of(replaced(points, "stator = \"pad\"", "stator = \"disc\""), {}), {"both"});
  check_message(error_of(replaced(points, "normal = \"y\"", "normal = \"y\"\ntangents = \"y\""), {}), {"square"});
  check_message(error_of(replaced(brake, "rotation = {", "velocity = [1, 0, 0]\nrotation = {"), {}), {"exclude"});
  check_message(error_of(replaced(brake, "step_size = 1e-6", ""), {}), {"step_size", "together"});
  check_message(error_of(replaced(brake, "stiffness = 1e6\ndamping = 3", ""), {}), {"neither"});
  check_message(error_of(replaced(brake, "fixed = \"all\"", "fixed = \"none\""), {}), {"nothing"});
  check_message(error_of(replaced(brake, "direction = \"-y\"\n", ""), {}), {"'direction'"});
  check_message(error_of(replaced(brake, "on = \"disc\"\nat", "on = \"dof:3\"\nat"), {}), {"dof:3", "matrix scenes"});
}

TEST_CASE("the reference lists every key of the resolved scene")
{
  const std::string reference = scene_reference();
  for (const char* key : {"coefficient", "steps_per_period", "free_periods", "step_size", "theta", "surfaces", "axis",
                          "direction_damping", "kg/m3", "default"})
    CHECK(reference.find(key) != std::string::npos);
}

TEST_CASE("a number is set through its member as a file would set it, and its key says what it changes")
{
  Scene scene;
  scene.points = {{"tip", {}, 1, {}}, {"base", {}, 0, {}}};
  scene.springs = {{"tip", ground, {1, 0, 0}, 100, 2}};
  scene.forces = {{"tip", {0, 0, -5}}};
  scene.contacts.emplace_back();
  scene.contacts[0].rotor = "base";
  scene.contacts[0].stator = "tip";
  scene.contacts[0].normal = Vec3{0, 0, 1};
  scene.contacts[0].velocity = {1, 0, 0};
  const auto with = [&](const std::string& key, double value)
  {
    const SceneNumber number{key, value};
    return scene_with(scene, std::span(&number, 1));
  };
  CHECK(with("point.tip.mass", 3).points[0].mass == 3);
  CHECK(with("spring.0.stiffness", 7).springs[0].stiffness == 7);
  CHECK(with("force.0.vector.2", -9).forces[0].vector[2] == -9);
  CHECK(with("contact.0.velocity.0", 2).contacts[0].velocity == Vec3{2, 0, 0});
  CHECK(with("friction.coefficient", 0.4).friction.coefficient == 0.4);
  CHECK_THROWS_AS(with("contact.0.friction", 0.1), Error); // it has none of its own
  scene.contacts[0].friction = FrictionLaw{0.2};
  CHECK(with("contact.0.friction", 0.1).contacts[0].friction->coefficient == 0.1);
  CHECK(with("friction.coefficient", 0.4).contacts[0].friction->coefficient == 0.2);
  CHECK(with("spring.0.direction.1", 1).springs[0].direction[1] == doctest::Approx(std::sqrt(0.5)));
  CHECK_THROWS_WITH_AS(with("spring.0.stiffness", -1),
                       "--set spring.0.stiffness=-1: [[spring]] stiffness = -1: expected zero or a positive number "
                       "[N/m]",
                       Error);
  CHECK_THROWS_AS(with("spring.1.stiffness", 1), Error);
  CHECK_THROWS_AS(with("force.0.vector.3", 1), Error);

  scene.contacts[0].rotation = Rotation{{0, 0, 1}, {}, 5};
  scene.contacts[0].velocity = {};
  CHECK(with("contact.0.rotation.centre.0", 0.5).contacts[0].rotation->centre[0] == 0.5);

  scene.parts.emplace_back().name = "disc";
  scene.parts[0].material.orthotropy.emplace();
  const auto effect = [&](const char* key) { return description_of(scene, key).effect; };
  CHECK(effect("cycle.theta") == Effect::nothing);
  CHECK(effect("force.0.vector.2") == Effect::load);
  CHECK(effect("friction.coefficient") == Effect::friction);
  CHECK(effect("contact.0.friction") == Effect::friction);
  CHECK(effect("contact.0.gap") == Effect::gap);
  CHECK(effect("contact.0.rotation.rate") == Effect::drive);
  CHECK(effect("damping.alpha") == Effect::damping);
  CHECK(effect("part.disc.density") == Effect::mass);
  CHECK(effect("part.disc.young") == Effect::stiffness_and_mass);
  CHECK(effect("part.disc.orthotropic.young.0") == Effect::stiffness_and_mass);
  CHECK(effect("point.tip.at.0") == Effect::mesh);
  scene.parts.emplace_back().rotation = Rotation{};
  CHECK(effect("part.disc.density") == Effect::stiffness_and_mass);
}

TEST_CASE("a named number stands wherever a key takes one, drives all of its places and is written by its name")
{
  const TemporaryFolder folder;
  const auto read = [&](const std::string& text, const std::vector<std::string>& overrides)
  { return read_scene(folder.write("scene.toml", text), overrides); };
  const std::string text = "[numbers]\nclamp = 600\nspeed = 2\n" +
                           replaced(points, "velocity = [1, 0, 0]", "velocity = [\"-speed\", 0, 0]") +
                           "[[force]]\non = \"pad\"\nvector = [0, \"-clamp\", 0]\n[[spring]]\nfrom = \"disc\"\n"
                           "direction = \"y\"\nstiffness = \"clamp\"\n";
  const Scene scene = read(text, {});
  CHECK(scene.forces[0].vector == Vec3{0, -600, 0});
  CHECK(scene.springs[0].stiffness == 600);
  CHECK(scene.contacts[0].velocity == Vec3{-2, 0, 0});
  const Scene given = read(text, {"numbers.clamp=50"});
  CHECK(given.forces[0].vector[1] == -50);
  CHECK(given.springs[0].stiffness == 50);

  const SceneNumber other{"numbers.clamp", 70};
  const Scene changed = scene_with(scene, std::span(&other, 1));
  CHECK(changed.forces[0].vector == Vec3{0, -70, 0});
  CHECK(changed.springs[0].stiffness == 70);
  const std::vector<SceneNumber> driven = driven_by(scene, std::span(&other, 1));
  REQUIRE(driven.size() == 2);
  CHECK((driven[0].key == "spring.0.stiffness" || driven[1].key == "spring.0.stiffness"));
  CHECK(driven_by(scene, driven).size() == 2);
  CHECK(description_of(scene, "numbers.speed").name == "contact.0.velocity.0");

  const std::string resolved = resolved_scene(scene);
  CHECK(resolved.find("\"-clamp\"") != std::string::npos);
  CHECK(resolved.find("stiffness = \"clamp\"") != std::string::npos);
  CHECK(resolved_scene(read(resolved, {})) == resolved);
  CHECK(read(resolved, {"numbers.clamp=1"}).forces[0].vector[1] == -1);

  check_message(error_of(text, {"spring.0.stiffness=clamps"}), {"stiffness", "clamps"});
  check_message(error_of(text, {"numbers.clamp=-1"}), {"stiffness", "-1"});
  check_message(error_of(text, {"sweep.key=numbers.clam", "sweep.from=1", "sweep.to=2"}),
                {"numbers.clam", "numbers.clamp"});
}

TEST_CASE("a rotor moves the contacts of its part, and says what is wrong with it")
{
  const TemporaryFolder folder;
  const std::string own = "velocity = [1, 0, 0]\n", belt = "[[rotor]]\npart = \"disc\"\nvelocity = [1, 0, 0]\n";
  Scene scene = read_scene(folder.write("scene.toml", replaced(points, own, "") + belt), {});
  CHECK(is_undriven(scene.contacts[0]));
  drive_contacts(scene, std::array{0});
  CHECK(scene.contacts[0].velocity == Vec3{1, 0, 0});
  const SceneNumber faster{"rotor.0.velocity.0", 3};
  CHECK(scene_with(scene, std::span(&faster, 1)).contacts[0].velocity == Vec3{3, 0, 0});
  Scene both = read_scene(folder.write("both.toml", points + belt), {});
  CHECK_THROWS_AS(drive_contacts(both, std::array{0}), Error);
  CHECK_THROWS_AS(drive_contacts(scene, std::array{-1}), Error);
  check_message(error_of(points + belt + belt, {}), {"[[rotor]]", "twice"});
  check_message(error_of(points + belt, {"rotor.0.part=wheel"}), {"wheel", "not defined"});
  check_message(error_of(points + belt, {"rotor.0.axis=z", "rotor.0.rate=2"}), {"rate and a velocity"});
  check_message(error_of(points + "[[rotor]]\npart = \"disc\"\nrate = 3\n", {}), {"needs axis and rate"});
}

TEST_CASE("design points come from a file, whose head names numbers of the scene")
{
  const TemporaryFolder folder;
  folder.write("points.csv", "# a remark\nfriction.coefficient, numbers.speed\n0.1,1\n\n0.2,-2\n");
  folder.write("short.csv", "friction.coefficient,numbers.speed\n0.1\n");
  folder.write("word.csv", "friction.coefficient\nmuch\n");
  folder.write("other.csv", "friction.coefficients\n0.1\n");
  const std::string text = "[numbers]\nspeed = 1\n" + replaced(points, "[1, 0, 0]", "[\"speed\", 0, 0]");
  const auto read = [&](const std::string& file)
  { return read_scene(folder.write("scene.toml", text), {"sweep.table=" + file}); };
  const Scene scene = read("points.csv");
  CHECK(scene.sweep->key == std::vector<std::string>{"friction.coefficient", "numbers.speed"});
  CHECK(scene.sweep->design == std::vector<std::vector<double>>{{0.1, 1}, {0.2, -2}});
  const std::string resolved = resolved_scene(scene);
  CHECK(resolved_scene(read_scene(folder.write("resolved.toml", resolved), {})) == resolved);
  CHECK_THROWS_AS(read("short.csv"), Error);
  CHECK_THROWS_AS(read("word.csv"), Error);
  CHECK_THROWS_AS(read("other.csv"), Error);
  CHECK_THROWS_AS(read("none.csv"), Error);
}
