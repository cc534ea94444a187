/// fields.h5 with fields.xdmf for ParaView: the mesh and what moves on it. Nodal displacements are u_nodes = T u.
///
/// One temporal collection, a grid per sample of the cycle; the equilibrium and the modes are the same data in each.
/// Without a cycle it has one grid. XDMF lists an element as its code and then its nodes, in VTK's order.
#include "files.hpp"
#include "squeal/base/whole_file.hpp"
#include "squeal/report/results_folder.hpp"
#include "squeal/solid/sparse_rows.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>

namespace squeal
{

namespace
{

struct XdmfShape
{
  int code;
  std::vector<int> order; // of gmsh's nodes
};

XdmfShape xdmf_shape(Shape shape)
{
  switch (shape)
  {
  case Shape::hex8:
    return {9, {0, 1, 2, 3, 4, 5, 6, 7}};
  case Shape::wedge6:
    return {8, {0, 1, 2, 3, 4, 5}};
  case Shape::hex20:
    return {48, {0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15}};
  case Shape::tet4:
    return {6, {0, 1, 2, 3}};
  case Shape::tet10:
    return {38, {0, 1, 2, 3, 4, 5, 6, 7, 9, 8}};
  case Shape::shell4:
    return {5, {0, 1, 2, 3}};
  case Shape::shell3:
    return {4, {0, 1, 2}};
  }
  throw Error("an element shape without an XDMF type");
}

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
    const XdmfShape shape = xdmf_shape(element.shape);
    topology.push_back(shape.code);
    for (const int k : shape.order) topology.push_back(element.nodes[static_cast<std::size_t>(k)]);
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

/// fields.h5 while it is written. The file is rank 0's; functions are collective.
class Fields
{
public:
  Fields(const Model& model, const std::filesystem::path& place, const std::string& run, MPI_Comm comm)
      : model_(model), comm_(comm)
  {
    check(VecScatterCreateToZero(model.structure.load, scatter_.put(), whole_.put()));
    on_rank_zero(comm, [&] { write_mesh(file_.emplace(place, run, field_sets), model.mesh, layout); });
  }

  /// Work on rank 0 alone.
  template <class Work> void on_file(Work work)
  {
    on_rank_zero(comm_, [&] { work(*file_); });
  }

  /// Writes a vector of degrees of freedom as nodal displacements. `name`: of the field that ParaView shows at all
  /// times; empty: it is none.
  void write(Vec u, const std::string& data, const std::string& name) { write(nodal(u), data, name); }

  /// Writes the displacement of nodes at rest, with what supports move them by.
  void write_rest(Vec u, const std::string& data, const std::string& name)
  {
    std::vector<double> values = nodal(u);
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] += model_.dofs.shift_of(static_cast<PetscInt>(6 * (i / 3) + i % 3));
    write(values, data, name);
  }

  Layout layout;

private:
  void write(const std::vector<double>& values, const std::string& data, const std::string& name)
  {
    on_file([&](Hdf5File& file) { file.write(data, values, 3); });
    if (!name.empty()) layout.still.push_back({name, data, 3});
  }

  /// x y z of every node [m] on rank 0, empty elsewhere.
  std::vector<double> nodal(Vec u) const
  {
    check(VecScatterBegin(scatter_, u, whole_, INSERT_VALUES, SCATTER_FORWARD));
    check(VecScatterEnd(scatter_, u, whole_, INSERT_VALUES, SCATTER_FORWARD));
    PetscInt size = 0;
    check(VecGetLocalSize(whole_, &size));
    if (size == 0) return {};
    const PetscScalar* values = nullptr;
    check(VecGetArrayRead(whole_, &values));
    std::vector<double> displacement;
    displacement.reserve(3 * model_.mesh.nodes.size());
    for (std::size_t node = 0; node < model_.mesh.nodes.size(); ++node)
      for (int component = 0; component < 3; ++component)
      {
        double sum = 0;
        for (const DofTerm& term : model_.dofs.terms_of(static_cast<PetscInt>(6 * node) + component))
          sum += term.factor * values[term.dof];
        displacement.push_back(sum);
      }
    check(VecRestoreArrayRead(whole_, &values));
    return displacement;
  }

  const Model& model_;
  MPI_Comm comm_;
  Owned<VecScatter> scatter_;
  Owned<Vec> whole_;
  std::optional<Hdf5File> file_; // on rank 0
};

void write_modes(Fields& fields, const Modes& modes)
{
  int number = 0;
  for (const ComplexMode& mode : modes.modes)
  {
    const bool grows = is_unstable(mode.lambda);
    if (!grows && modes.shapes == ModeShapes::unstable) continue;
    const std::string data = "modes/" + std::to_string(++number) + "/";
    const std::string name =
        format("%s %d, %ld Hz, ", grows ? "unstable mode" : "mode", number, std::lround(mode.frequency_hz()));
    fields.write(mode.real, data + "real", name + "real part");
    fields.write(mode.imaginary, data + "imaginary", name + "imaginary part");
  }
}

constexpr Eigen::Index shown_shapes = 6; // of a settled motion in ParaView

void write_motion_shapes(Fields& fields, const MotionShapes& shapes, Vec like)
{
  const Owned<Vec> shape = zeros_like(like);
  for (Eigen::Index i = 0; i < shapes.V.columns(); ++i)
  {
    copy_column(shapes.V, i, shape);
    const std::string number = std::to_string(i + 1), data = "settled/shape_" + number;
    fields.write(shape, data, i < shown_shapes ? "shape " + number + " of the settled motion [kg^-1/2]" : "");
  }
}

/// Samples are spread evenly over the steps of the period and end with its last one [s].
double sample_time(const LimitCycle& cycle, std::size_t sample)
{
  const double steps = cycle.steps_per_period, samples = static_cast<double>(cycle.measured.displacements.size());
  return std::ceil(static_cast<double>(sample + 1) * steps / samples) * cycle.orbit.period / steps;
}

} // namespace

void write_fields(const Report& report, const Scene& scene, const Model& model, const std::filesystem::path& output,
                  MPI_Comm comm)
{
  if (scene.matrices) return;
  const Equilibrium& equilibrium = report.point.equilibrium;
  const LimitCycle& cycle = report.motion.cycle;
  Fields fields(model, output / word(ResultFile::fields), report.run, comm);
  fields.on_file(
      [&](Hdf5File& file)
      {
        write_pairs(file, equilibrium, model.interface);
        if (!scene.probes.empty()) file.write("probes/node", probed_nodes(scene.probes, model.mesh));
        if (equilibrium.u.get()) write_contact(file, equilibrium, model, fields.layout);
        for (int number = 0; const ModeCauses& causes : report.sensitivity.modes)
          file.write(format("modes/%d/pair_power", ++number), causes.pair_powers);
      });
  if (equilibrium.u.get())
    fields.write_rest(equilibrium.u, "equilibrium/displacement", "displacement at equilibrium [m]");
  write_modes(fields, report.point.modes);
  const Owned<Vec> part = zeros_like(model.structure.load);
  for (std::size_t i = 0; i < 2 * report.sensitivity.modes.size(); ++i)
  {
    copy_column(report.sensitivity.modes[i / 2].left, i % 2, part);
    fields.write(part, format("modes/%zu/left_%s", i / 2 + 1, i % 2 ? "imaginary" : "real"), "");
  }
  if (has_run(report.motion.settled.outcome))
    write_motion_shapes(fields, report.motion.settled.shapes, model.structure.load);
  for (std::size_t i = 0; i < cycle.measured.displacements.size(); ++i)
  {
    fields.write(cycle.measured.displacements[i], cycle_data(i), "");
    fields.layout.time.push_back(sample_time(cycle, i));
  }
  fields.on_file(
      [&](Hdf5File& file)
      {
        file.keep();
        write_whole_file(output / word(ResultFile::field_places), xdmf_text(fields.layout, report.run));
      });
}

} // namespace squeal
