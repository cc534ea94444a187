// ranks: 1 2 3
// Contact of meshes that do not match: what the rows of B must do on flat surfaces, whatever the faces.
#include "small_fem.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <numbers>

using namespace squeal;

namespace
{

const MPI_Comm& world = PETSC_COMM_WORLD; // set when the session starts

/// Shapes of solids by the faces that touch: 3, 4, 6, 8 and 9 nodes.
constexpr std::array shapes = {Shape::tet4, Shape::hex8, Shape::tet10, Shape::hex20, Shape::hex27};

/// Adds a body. Its faces whose corners all satisfy `is_on` become the surface `name:face`, those of `is_end` the
/// surface and group `name:end`.
using Condition = std::function<bool(const Vec3&)>;

void add_body(Mesh& mesh, const std::string& name, const small_fem::Mesh& body, const Condition& is_on,
              const Condition& is_end)
{
  const int first = static_cast<int>(mesh.nodes.size()), part = name == "low" ? 0 : 1;
  mesh.nodes.insert(mesh.nodes.end(), body.x.begin(), body.x.end());
  for (const auto& nodes : body.elements)
  {
    Element element{body.shape, part, {}};
    for (std::size_t i = 0; i < nodes.size(); ++i) element.nodes[i] = first + nodes[i];
    mesh.elements.push_back(element);
    for (const auto& corners : corner_faces(body.shape))
    {
      std::vector<int> face;
      for (const int corner : corners)
        if (corner >= 0) face.push_back(element.nodes[corner]);
      const auto all = [&](const Condition& condition)
      { return std::all_of(face.begin(), face.end(), [&](int node) { return condition(mesh.nodes[node]); }); };
      if (!all(is_on) && !all(is_end)) continue;
      const std::string surface = name + (all(is_on) ? ":face" : ":end");
      const Face& added = mesh.surfaces[surface].emplace_back(face_on(element, face));
      auto& group = mesh.node_groups[surface];
      group.insert(group.end(), nodes_of(added).begin(), nodes_of(added).end());
      std::sort(group.begin(), group.end());
      group.erase(std::unique(group.begin(), group.end()), group.end());
    }
  }
}

/// Where the two blocks lie: the low one from z = -1/2, the high one above it.
struct Layout
{
  const char* name;
  int low, high;          // elements along a side
  double low_side, angle; // [m, degrees] of the low block about the high one's middle; the high one has 1 m
};

constexpr Layout layouts[] = {{"matching", 3, 3, 1, 0},
                              {"3:2", 2, 3, 1, 0},
                              {"2:3", 3, 2, 1, 0},
                              {"rotor larger and turned", 4, 3, 2.4, 17},
                              {"stator hangs over, turned", 2, 4, 0.7, 17}};

struct Blocks
{
  Mesh mesh;
  Scene scene;
};

Blocks blocks(const Layout& layout, Shape low, Shape high)
{
  const double turn = layout.angle * std::numbers::pi / 180;
  const auto below = [&](double a, double b, double c)
  {
    const double x = layout.low_side * (a - 0.5), y = layout.low_side * (b - 0.5);
    return Vec3{0.5 + std::cos(turn) * x - std::sin(turn) * y, 0.5 + std::sin(turn) * x + std::cos(turn) * y,
                (c - 1) / 2};
  };
  const auto above = [](double a, double b, double c) { return Vec3{a, b, c / 2}; };
  const Condition face = [](const Vec3& x) { return std::abs(x[2]) < 1e-9; };
  const Condition end = [](const Vec3& x) { return std::abs(x[2]) > 0.5 - 1e-9; };
  Blocks result;
  add_body(result.mesh, "low", small_fem::in_shape(small_fem::bricks({layout.low, layout.low, 1}, below), low), face,
           end);
  add_body(result.mesh, "high", small_fem::in_shape(small_fem::bricks({layout.high, layout.high, 1}, above), high),
           face, end);
  Scene& scene = result.scene;
  scene.parts = {{"low", {2e9, 0, 1000}, 0, {}}, {"high", {1e9, 0, 1000}, 0, {}}};
  Contact contact;
  contact.rotor = "low:face";
  contact.stator = "high:face";
  contact.velocity = {1, 0, 0};
  scene.contacts = {contact};
  return result;
}

/// What every pair gives to the nodes of its slave side or of the other, under unit pressure: D_i times the weights.
std::map<int, double> forces(const std::vector<ContactPair>& pairs, bool slave_side)
{
  std::map<int, double> force;
  for (const ContactPair& pair : pairs)
    for (std::size_t k = 0; k < pair.nodes.size(); ++k)
      if ((static_cast<int>(k) < pair.slave_nodes) == slave_side)
        force[pair.nodes[k].node] += pair.area * pair.nodes[k].weight;
  return force;
}

/// The largest difference of two lists of nodal forces.
double difference(const std::map<int, double>& a, const std::map<int, double>& b)
{
  double largest = 0;
  for (const auto& [node, value] : a)
    largest = std::max(largest, std::abs(value - (b.contains(node) ? b.at(node) : 0)));
  for (const auto& [node, value] : b)
    largest = std::max(largest, std::abs(value - (a.contains(node) ? a.at(node) : 0)));
  return largest;
}

std::vector<ContactPair> pairs_of(Blocks blocks, SlaveSide slave)
{
  blocks.scene.contacts[0].slave = slave;
  return make_pairs(blocks.mesh, blocks.scene).pairs;
}

template <class Work> void for_each_case(Work work)
{
  for (const Layout& layout : layouts)
    for (const Shape low : shapes)
      for (const Shape high : shapes)
      {
        CAPTURE(layout.name);
        CAPTURE(static_cast<int>(low));
        CAPTURE(static_cast<int>(high));
        work(layout, blocks(layout, low, high));
      }
}

/// A model with its rows.
struct PatchModel
{
  DofMap dofs;
  Structure structure;
  std::vector<ContactPair> pairs;
  Interface interface;
};

PatchModel model_of(const Blocks& blocks)
{
  PatchModel model;
  model.pairs = make_pairs(blocks.mesh, blocks.scene).pairs;
  const Partition partition = partition_mesh(blocks.mesh, model.pairs, ranks_of(world));
  model.dofs = number_dofs(blocks.mesh, blocks.scene, partition, world);
  model.structure = assemble({blocks.mesh, partition, model.dofs}, blocks.scene, world);
  model.interface = make_interface(model.pairs, blocks.scene, model.dofs, world);
  return model;
}

} // namespace

TEST_CASE("what one side hands on is what the other integrates over the same part of itself")
{
  // Unit pressure over the covered part: the rows of either side as slave give both sides' consistent nodal forces.
  // Rounding of some 100 products on areas of 1.
  for_each_case(
      [](const Layout& layout, const Blocks& b)
      {
        const auto by_stator = pairs_of(b, SlaveSide::stator), by_rotor = pairs_of(b, SlaveSide::rotor);
        // Rows on slivers carry the rounding of the inverse of a small Gram matrix.
        CHECK(difference(forces(by_stator, false), forces(by_rotor, true)) < 1e-11);
        CHECK(difference(forces(by_stator, true), forces(by_rotor, false)) < 1e-11);
        double area = 0;
        for (const ContactPair& pair : by_stator) area += pair.area;
        const double covered = layout.low_side < 1 ? layout.low_side * layout.low_side : 1;
        CHECK(area == approx(covered, 1e-12));
        for (const ContactPair& pair : by_stator) CHECK(pair.area > 0);
      });
}

TEST_CASE("matching meshes have the rows of coincident nodes, mid-sides less half of their ends")
{
  for (const Shape shape : shapes)
    for (const SlaveSide slave : {SlaveSide::stator, SlaveSide::rotor})
    {
      const Blocks b = blocks(layouts[0], shape, shape);
      const auto pairs = pairs_of(b, slave);
      CHECK(pairs.size() == b.mesh.node_groups.at("high:face").size());
      for (const ContactPair& pair : pairs)
      {
        CHECK(norm(b.mesh.nodes[pair.rotor_node] - b.mesh.nodes[pair.stator_node]) < 1e-15);
        CHECK(norm(pair.normal - Vec3{0, 0, 1}) < 1e-15);
        REQUIRE(pair.nodes.size() == 2 * static_cast<std::size_t>(pair.slave_nodes));
        if (shape == Shape::tet4 || shape == Shape::hex8) CHECK(pair.slave_nodes == 1);
        const double sign = slave == SlaveSide::stator ? 1 : -1;
        double own = 0, other = 0;
        for (std::size_t k = 0; k < pair.nodes.size(); ++k)
        {
          const auto& [node, weight] = pair.nodes[k];
          const bool main = node == pair.rotor_node || node == pair.stator_node;
          // The middle of a face: 4, less its mid-sides, and a quarter of its corners.
          const auto is_whole = [](double x) { return std::abs(x - std::round(x)) < 1e-9; };
          const bool corner = is_whole(3 * b.mesh.nodes[node][0]) && is_whole(3 * b.mesh.nodes[node][1]);
          const double expected = pair.slave_nodes == 1   ? 1
                                  : pair.slave_nodes == 3 ? (main ? 2 : -0.5)
                                                          : (main     ? 4
                                                             : corner ? 0.25
                                                                      : -1);
          const double side = static_cast<int>(k) < pair.slave_nodes ? sign : -sign;
          CHECK(std::abs(weight - side * expected) < 1e-12); // rounding of an inverse Gram matrix of condition 1000
          (side == sign ? own : other) += weight;
        }
        CHECK(std::abs(own + other) < 1e-15);
      }
    }
}

TEST_CASE("constant pressure passes through")
{
  for_each_case(
      [](const Layout&, Blocks b)
      {
        constexpr double pressure = 1e6;
        b.scene.supports = {{"low:end", {true, true, true}}, {"high:end", {true, true, false}}};
        b.scene.pressures = {{"high:end", pressure}};
        const PatchModel model = model_of(b);
        // The parts that face nothing carry the same pressure: the whole surface's nodal forces less the pairs'.
        std::map<int, double> load;
        for (const char* surface : {"low:face", "high:face"})
          for (const Face& face : b.mesh.surfaces.at(surface))
          {
            std::vector<Vec3> x;
            for (const int node : nodes_of(face)) x.push_back(b.mesh.nodes[node]);
            const auto weights = face_weights(face.shape, x);
            for (std::size_t i = 0; i < weights.size(); ++i) load[face.nodes[i]] -= pressure * weights[i][2];
          }
        // Those of the rows with the other side as slave, which integrate the covered part themselves.
        const auto other = pairs_of(b, SlaveSide::rotor);
        for (const bool side : {true, false})
          for (const auto& [node, force] : forces(other, side)) load[node] -= pressure * force;
        for (const auto& [node, force] : load)
          for (const DofTerm& term : model.dofs.terms_of(6 * PetscInt{node} + 2))
            if (rank_of(world) == 0)
              check(VecSetValue(model.structure.load, term.dof, force * term.factor, ADD_VALUES));
        check(VecAssemblyBegin(model.structure.load));
        check(VecAssemblyEnd(model.structure.load));

        const Equilibrium equilibrium = find_equilibrium(model.structure, model.interface, {});
        REQUIRE(equilibrium.outcome.kind == OutcomeKind::converged);
        const PairView r(equilibrium.reactions, equilibrium.directions);
        for (std::size_t i = 0; i < model.pairs.size(); ++i)
          CHECK(r.normal(i) / model.pairs[i].area == approx(pressure, 1e-10));
      });
}

TEST_CASE("rigid motions of both surfaces open nothing, and the two forces of a pair act at one place")
{
  for_each_case(
      [](const Layout&, const Blocks& b)
      {
        const ContactPairs contact = make_pairs(b.mesh, b.scene);
        CHECK(contact.coverage[0].offset < 1e-11); // rows on slivers carry the rounding of a small Gram matrix
        for (const ContactPair& pair : contact.pairs)
        {
          Vec3 lever{};
          double sum = 0;
          for (const auto& [node, weight] : pair.nodes)
          {
            lever = lever + weight * b.mesh.nodes[node];
            sum += weight;
          }
          CHECK(std::abs(sum) < 1e-14);
          CHECK(norm(lever) < 1e-11);
        }
      });
}

TEST_CASE("slave nodes on a support hand their rows over: the others keep full rank and the pressure")
{
  for (const Shape shape : shapes)
  {
    Blocks b = blocks(layouts[1], shape, shape);
    b.scene.supports = {{"low:end", {true, true, true}}, {"rim", {true, true, true}}};
    for (const int node : b.mesh.node_groups.at("high:face"))
      if (b.mesh.nodes[node][0] < 1e-9) b.mesh.node_groups["rim"].push_back(node);
    const auto all = pairs_of(blocks(layouts[1], shape, shape), SlaveSide::stator);
    const PatchModel model = model_of(b);
    // The two corners coincide with master nodes, which nothing else of the rim reads alone: they keep their rows.
    CHECK(model.pairs.size() + b.mesh.node_groups.at("rim").size() == all.size() + 2);
    double area = 0;
    for (const ContactPair& pair : model.pairs) area += pair.area;
    CHECK(area == approx(1, 1e-12));
    CHECK(difference(forces(all, false), forces(model.pairs, false)) < 1e-12);

    const std::vector<char> closed(model.pairs.size(), 1);
    const ClosedContact contact = eliminate_closed_pairs(model.structure, model.interface, closed);
    Owned<Mat> normal_rows = rows_of(model.interface, contact.pairs, RowsTaken::normal), left;
    check(MatMatMult(normal_rows, contact.Z, MAT_INITIAL_MATRIX, PETSC_DEFAULT, left.put()));
    double size = 0;
    check(MatNorm(left, NORM_FROBENIUS, &size));
    CHECK(size < 1e-12);
  }
}

TEST_CASE("a slave surface that is held all over is refused, and the other side as slave is the remedy")
{
  Blocks b = blocks(layouts[1], Shape::hex8, Shape::hex8);
  b.scene.supports = {{"high:face", {false, false, true}}};
  CHECK_THROWS_WITH_AS(make_pairs(b.mesh, b.scene), doctest::Contains("slave = \"rotor\""), Error);
  b.scene.contacts[0].slave = SlaveSide::rotor;
  CHECK(make_pairs(b.mesh, b.scene).pairs.size() == 9);
}

TEST_CASE("on curved surfaces the levers of a pair's forces shrink with the elements")
{
  // A cap of a sphere of radius 1 between blocks of n and 3n/2 elements. Chords stand off the sphere by h^2/8.
  const auto cap = [](double a, double b, double high)
  {
    const double x = 0.6 * (a - 0.5), y = 0.6 * (b - 0.5);
    return Vec3{x, y, std::sqrt(1 - x * x - y * y) + high};
  };
  const auto coverage = [&](int n)
  {
    Blocks b;
    const Condition face = [](const Vec3& x) { return std::abs(norm(x) - 1) < 1e-9; };
    const Condition end = [](const Vec3& x) { return std::abs(norm(x) - 1) > 0.1; };
    add_body(b.mesh, "low",
             small_fem::bricks({n, n, 1}, [&](double x, double y, double z) { return cap(x, y, z - 1); }), face, end);
    add_body(b.mesh, "high",
             small_fem::bricks({3 * n / 2, 3 * n / 2, 1}, [&](double x, double y, double z) { return cap(x, y, z); }),
             face, end);
    b.scene = blocks(layouts[0], Shape::hex8, Shape::hex8).scene;
    return make_pairs(b.mesh, b.scene).coverage[0];
  };
  const Coverage coarse = coverage(8), fine = coverage(16);
  const double h = 0.6 / 8;
  CHECK(coarse.closed < h * h / 4); // a chord of either side
  CHECK(coarse.closed / fine.closed > 3.5);
  CHECK(coarse.offset < 0.02 * coarse.closed);
  CHECK(coarse.offset / fine.offset > 6); // third order: 7.7
}
