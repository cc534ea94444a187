/// fields.h5 with fields.xdmf for ParaView: the mesh and what moves on it. Nodal displacements are u_nodes = T u.
///
/// One temporal collection, a grid per sample of the cycle; the equilibrium and the modes are the same data in each.
/// Without a cycle it has one grid. XDMF lists an element as its code and then its nodes, in VTK's order.
#include "files.hpp"
#include "squeal/base/whole_file.hpp"
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/report/results_folder.hpp"
#include "squeal/solid/structure.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace squeal
{

namespace
{

struct XdmfShape
{
  Shape shape;
  int code;
  std::vector<int> order{}; // of gmsh's nodes; empty: theirs
};

const std::array xdmf_shapes = {
    XdmfShape{Shape::triangle3, 4},
    XdmfShape{Shape::quad4, 5},
    XdmfShape{Shape::triangle6, 36},
    XdmfShape{Shape::quad8, 37},
    XdmfShape{Shape::quad9, 35},
    XdmfShape{Shape::tet4, 6},
    XdmfShape{Shape::pyramid5, 7},
    XdmfShape{Shape::wedge6, 8},
    XdmfShape{Shape::hex8, 9},
    XdmfShape{Shape::tet10, 38, {0, 1, 2, 3, 4, 5, 6, 7, 9, 8}},
    XdmfShape{Shape::pyramid13, 39, {0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12}},
    XdmfShape{Shape::pyramid14, 39, {0, 1, 2, 3, 4, 5, 8, 10, 6, 7, 9, 11, 12}}, // without the middle of its base
    XdmfShape{Shape::wedge15, 40, {0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11}},
    XdmfShape{Shape::wedge18, 41, {0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16}},
    XdmfShape{Shape::hex20, 48, {0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15}},
    XdmfShape{Shape::hex27, 50, {0,  1,  2,  3,  4,  5,  6,  7,  8,  11, 13, 9,  16, 18,
                                 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26}}};

constexpr int polyvertex = 1; // followed by its number of nodes

/// A field at the nodes, a scalar or a vector, by its name in ParaView and the name of its data.
struct Field
{
  std::string name, data;
  int components = 1;
};

/// Sizes and fields of the file, for the XDMF text.
struct Layout
{
  std::size_t nodes = 0, cells = 0, topology = 0; // topology: integers
  std::vector<Field> still;                       // the same at every time
  std::vector<double> time;                       // [s]
};

void write_mesh(Hdf5File& file, const Mesh& mesh, Layout& layout)
{
  std::vector<int> topology, part;
  for (const Element& element : mesh.elements)
  {
    const auto& [shape, code, order] = *std::ranges::find(xdmf_shapes, element.shape, &XdmfShape::shape);
    topology.push_back(code);
    if (order.empty()) std::ranges::copy(nodes_of(element), std::back_inserter(topology));
    for (const int k : order) topology.push_back(element.nodes[static_cast<std::size_t>(k)]);
    part.push_back(element.part);
  }
  for (const auto& [name, node] : mesh.points)
  {
    topology.insert(topology.end(), {polyvertex, 1, node});
    part.push_back(-1);
  }
  std::vector<double> position;
  for (const Vec3& x : mesh.nodes) position.insert(position.end(), x.begin(), x.end());
  layout.nodes = mesh.nodes.size();
  layout.cells = part.size();
  layout.topology = topology.size();
  file.write("mesh/nodes", position, 3);
  file.write("mesh/topology", topology);
  file.write("mesh/part", part);
}

/// Reactions of the equilibrium at the nodes of the pairs. Those of a pair are at its own node, and by their weights
/// at the nodes of the other side. Either side has the sum of all.
void write_contact(Hdf5File& file, const Equilibrium& equilibrium, const Model& model, Layout& layout)
{
  const PairView reactions(equilibrium.reactions, equilibrium.directions);
  const std::vector<ContactPair>& pairs = model.interface.geometry;
  if (pairs.empty() || reactions.pairs() != pairs.size()) return;
  std::vector<double> normal(model.mesh.nodes.size(), 0), friction = normal, area = normal, pressure = normal;
  const auto add = [&](std::size_t i, int number, double share)
  {
    const auto node = static_cast<std::size_t>(number);
    normal[node] += share * reactions.normal(i);
    friction[node] += share * length(reactions.tangential(i));
    pressure[node] += std::abs(share) * reactions.normal(i);
    area[node] += std::abs(share) * pairs[i].area;
  };
  for (std::size_t i = 0; i < pairs.size(); ++i)
  {
    const auto own = static_cast<std::size_t>(pairs[i].slave_nodes);
    const double sign = pairs[i].node == pairs[i].stator_node ? -1 : 1; // of the other side's weights
    add(i, pairs[i].node, 1);
    for (std::size_t k = own; k < pairs[i].nodes.size(); ++k)
      add(i, pairs[i].nodes[k].node, sign * pairs[i].nodes[k].weight);
  }
  for (std::size_t node = 0; node < area.size(); ++node)
    pressure[node] = area[node] > 0 ? pressure[node] / area[node] : 0;
  const auto write = [&](const char* name, const char* data, const std::vector<double>& values)
  {
    file.write(data, values);
    layout.still.push_back({name, data});
  };
  write("contact pressure at equilibrium [Pa]", "equilibrium/pressure", pressure);
  write("normal reaction at equilibrium [N]", "equilibrium/normal_reaction", normal);
  write("friction at equilibrium [N]", "equilibrium/friction_reaction", friction);
}

/// The pairs, one a row, with the reactions and pressures of the equilibrium where there is one.
void write_pairs(Hdf5File& file, const Equilibrium& equilibrium, const Interface& interface)
{
  const std::vector<ContactPair>& pairs = interface.geometry;
  if (pairs.empty()) return;
  const auto write = [&](const char* name, auto value_of)
  {
    std::vector<decltype(value_of(0))> values;
    for (std::size_t i = 0; i < pairs.size(); ++i) values.push_back(value_of(i));
    file.write(name, values);
  };
  const auto write_vector = [&](const char* name, auto vector_of)
  {
    std::vector<double> values;
    for (std::size_t i = 0; i < pairs.size(); ++i)
      for (const double entry : vector_of(i)) values.push_back(entry);
    file.write(name, values, 3);
  };
  write("pairs/node", [&](std::size_t i) { return pairs[i].node; });
  write("pairs/contact", [&](std::size_t i) { return pairs[i].contact; });
  write("pairs/area", [&](std::size_t i) { return pairs[i].area; });
  write("pairs/gap", [&](std::size_t i) { return interface.gap[i]; });
  write_vector("pairs/position", [&](std::size_t i) { return pairs[i].position; });
  write_vector("pairs/normal", [&](std::size_t i) { return pairs[i].normal; });
  write_vector("pairs/tangent_1", [&](std::size_t i) { return interface.tangents[i][0]; });
  write_vector("pairs/tangent_2", [&](std::size_t i) { return interface.tangents[i][1]; });
  if (equilibrium.reactions.size() != interface.size()) return;
  const PairView reactions(equilibrium.reactions, equilibrium.directions);
  write_vector("pairs/reaction", [&](std::size_t i) { return reactions.vector(i); });
  write("pairs/pressure", [&](std::size_t i) { return pairs[i].area > 0 ? reactions.normal(i) / pairs[i].area : 0; });
}

std::string data_item(const std::string& data, const std::string& dimensions, const char* type)
{
  return "<DataItem Dimensions=\"" + dimensions + "\" " + type + " Format=\"HDF\">fields.h5:/" + data + "</DataItem>";
}

constexpr const char* integers = "NumberType=\"Int\" Precision=\"4\"";
constexpr const char* reals = "NumberType=\"Float\" Precision=\"8\"";

std::string attribute_text(const char* type, const char* center, const std::string& name, const std::string& item)
{
  return "        <Attribute Name=\"" + name + "\" AttributeType=\"" + type + "\" Center=\"" + center + "\">" + item +
         "</Attribute>\n";
}

std::string field_text(const Field& field, const Layout& layout)
{
  const bool is_vector = field.components == 3;
  const std::string size = std::to_string(layout.nodes) + (is_vector ? " 3" : "");
  return attribute_text(is_vector ? "Vector" : "Scalar", "Node", field.name, data_item(field.data, size, reals));
}

std::string cycle_data(std::size_t sample)
{
  return "cycle/displacement_" + std::to_string(sample);
}

std::string xdmf_text(const Layout& layout, const std::string& run)
{
  std::ostringstream text;
  text.precision(17);
  text << "<?xml version=\"1.0\"?>\n<!DOCTYPE Xdmf SYSTEM \"Xdmf.dtd\" []>\n<Xdmf Version=\"3.0\">\n  <Domain>\n"
       << "    <Information Name=\"run\" Value=\"" << run << "\"/>\n"
       << "    <Grid Name=\"squeal\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
  const std::size_t samples = std::max<std::size_t>(layout.time.size(), 1);
  for (std::size_t i = 0; i < samples; ++i)
  {
    text << "      <Grid Name=\"brake\" GridType=\"Uniform\">\n        <Time Value=\""
         << (layout.time.empty() ? 0. : layout.time[i]) << "\"/>\n        <Topology TopologyType=\"Mixed\" "
         << "NumberOfElements=\"" << layout.cells << "\">"
         << data_item("mesh/topology", std::to_string(layout.topology), integers) << "</Topology>\n"
         << "        <Geometry GeometryType=\"XYZ\">"
         << data_item("mesh/nodes", std::to_string(layout.nodes) + " 3", reals) << "</Geometry>\n";
    text << attribute_text("Scalar", "Cell", "part", data_item("mesh/part", std::to_string(layout.cells), integers));
    for (const Field& field : layout.still) text << field_text(field, layout);
    if (!layout.time.empty()) text << field_text({"displacement in the cycle [m]", cycle_data(i), 3}, layout);
    text << "      </Grid>\n";
  }
  text << "    </Grid>\n  </Domain>\n</Xdmf>\n";
  return text.str();
}

/// A motion of all nodes.
struct NodalField
{
  std::string data, name;       // in the file; in ParaView at all times, empty: it is not shown
  std::vector<double> values{}; // x y z of every node; on rank 0
};

class NodalFields
{
public:
  explicit NodalFields(const Model& model) : model_(model) {}

  const std::vector<NodalField>& all() const { return all_; }

  /// Adds a vector of degrees of freedom. Collective.
  void add(Vec u, const std::string& data, const std::string& name)
  {
    NodalField& field = all_.emplace_back(data, name);
    const std::vector<double> q = all_entries(u);
    if (rank_of(comm_of(u)) != 0) return;
    field.values.resize(3 * model_.mesh.nodes.size());
    for (std::size_t i = 0; i < field.values.size(); ++i)
      for (const DofTerm& term : model_.dofs.terms_of(nodal_dof(i)))
        field.values[i] += term.factor * q[static_cast<std::size_t>(term.dof)];
  }

  /// Adds to the last one what supports move.
  void add_shift()
  {
    std::vector<double>& values = all_.back().values;
    for (std::size_t i = 0; i < values.size(); ++i) values[i] += model_.dofs.shift_of(nodal_dof(i));
  }

private:
  static PetscInt nodal_dof(std::size_t entry) { return static_cast<PetscInt>(6 * (entry / 3) + entry % 3); }

  const Model& model_;
  std::vector<NodalField> all_{};
};

void add_mode_shapes(NodalFields& fields, const Modes& modes)
{
  int number = 0;
  for (const ComplexMode& mode : modes.modes)
  {
    const bool grows = is_unstable(mode.lambda);
    if (!grows && modes.shapes == ModeShapes::unstable) continue;
    const std::string data = "modes/" + std::to_string(++number) + "/";
    const std::string name =
        format("%s %d, %ld Hz, ", grows ? "unstable mode" : "mode", number, std::lround(mode.frequency_hz()));
    fields.add(mode.real, data + "real", name + "real part");
    fields.add(mode.imaginary, data + "imaginary", name + "imaginary part");
  }
}

constexpr Eigen::Index shown_shapes = 6; // of a settled motion in ParaView

void add_motion_shapes(NodalFields& fields, const MotionShapes& shapes, Vec shape)
{
  for (Eigen::Index i = 0; i < shapes.V.columns(); ++i)
  {
    copy_column(shapes.V, i, shape);
    const std::string number = std::to_string(i + 1), data = "settled/shape_" + number;
    fields.add(shape, data, i < shown_shapes ? "shape " + number + " of the settled motion [kg^-1/2]" : "");
  }
}

/// Samples are spread evenly over the steps of the period and end with its last one [s].
double sample_time(const LimitCycle& cycle, std::size_t sample)
{
  const double steps = cycle.steps_per_period, samples = static_cast<double>(cycle.measured.displacements.size());
  return std::ceil(static_cast<double>(sample + 1) * steps / samples) * cycle.orbit.period / steps;
}

NodalFields nodal_fields(const Report& report, const Model& model)
{
  NodalFields fields(model);
  const Owned<Vec> part = zeros_like(model.structure.load);
  if (report.point.equilibrium.u.get())
  {
    fields.add(report.point.equilibrium.u, "equilibrium/displacement", "displacement at equilibrium [m]");
    fields.add_shift();
  }
  add_mode_shapes(fields, report.point.modes);
  for (std::size_t i = 0; i < 2 * report.sensitivity.modes.size(); ++i)
  {
    copy_column(report.sensitivity.modes[i / 2].left, i % 2, part);
    fields.add(part, format("modes/%zu/left_%s", i / 2 + 1, i % 2 ? "imaginary" : "real"), "");
  }
  if (has_run(report.motion.settled.outcome)) add_motion_shapes(fields, report.motion.settled.shapes, part);
  const std::vector<Owned<Vec>>& cycle = report.motion.cycle.measured.displacements;
  for (std::size_t i = 0; i < cycle.size(); ++i) fields.add(cycle[i], cycle_data(i), "");
  return fields;
}

} // namespace

void write_fields(const Report& report, const Scene& scene, const Model& model, const std::filesystem::path& output,
                  MPI_Comm comm)
{
  if (scene.matrices) return;
  const NodalFields fields = nodal_fields(report, model);
  const auto write = [&]
  {
    Hdf5File file(output / word(ResultFile::fields), report.run, field_sets);
    Layout layout;
    write_mesh(file, model.mesh, layout);
    write_pairs(file, report.point.equilibrium, model.interface);
    if (!scene.probes.empty()) file.write("probes/node", probed_nodes(scene.probes, model.mesh));
    if (report.point.equilibrium.u.get()) write_contact(file, report.point.equilibrium, model, layout);
    for (int number = 0; const ModeCauses& causes : report.sensitivity.modes)
      file.write(format("modes/%d/pair_power", ++number), causes.pair_powers);
    for (const auto& [data, name, values] : fields.all())
    {
      file.write(data, values, 3);
      if (!name.empty()) layout.still.push_back({name, data, 3});
    }
    const LimitCycle& cycle = report.motion.cycle;
    for (std::size_t i = 0; i < cycle.measured.displacements.size(); ++i) layout.time.push_back(sample_time(cycle, i));
    file.keep();
    write_whole_file(output / word(ResultFile::field_places), xdmf_text(layout, report.run));
  };
  on_rank_zero(comm, write);
}

} // namespace squeal
