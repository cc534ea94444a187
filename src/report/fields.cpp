/// fields.h5 with fields.xdmf for ParaView: the mesh and what moves on it. Nodal displacements are u_nodes = T u.
///
/// One temporal collection, a grid per sample of the cycle; the equilibrium and the modes are the same data in each.
/// Without a cycle it has one grid. XDMF lists an element as its code and then its nodes, in VTK's order.
#include "squeal/report/fields.hpp"

#include "files.hpp"
#include "squeal/base/whole_file.hpp"
#include "squeal/report/result_files.hpp"
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

/// What a field has values at, as XDMF calls it.
enum class Center
{
  node,
  cell,
};

constexpr std::array xdmf_centers = {"Node", "Cell"};

const char* word(Center center)
{
  return xdmf_centers.at(static_cast<std::size_t>(center));
}

struct Attribute
{
  std::string name, data;
  Center center{};
  int components = 1;
};

/// Where each field of the file stands, for the XDMF text.
struct Layout
{
  std::size_t nodes = 0, cells = 0, topology = 0; // topology: integers
  std::vector<Attribute> still;                   // the same at every time
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
  file.write("mesh/nodes", {layout.nodes, 3}, position, "m");
  file.write("mesh/topology", {topology.size()}, topology, "XDMF mixed topology");
  file.write("mesh/part", {part.size()}, part, "index of the scene's part; -1: a point");
  layout.still.push_back({"part", "mesh/part", Center::cell, 1});
}

/// Brings vectors of degrees of freedom to rank 0 as nodal displacements.
class Gather
{
public:
  Gather(const Model& nodes) : nodes_(nodes)
  {
    check(VecScatterCreateToZero(nodes.structure.load, scatter_.put(), whole_.put()));
  }

  /// Collective. x y z of every node [m] on rank 0, empty elsewhere.
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
    displacement.reserve(3 * nodes_.mesh.nodes.size());
    for (std::size_t node = 0; node < nodes_.mesh.nodes.size(); ++node)
      for (int component = 0; component < 3; ++component)
      {
        double sum = 0;
        for (const DofTerm& term : nodes_.dofs.terms_of(static_cast<PetscInt>(6 * node) + component))
          sum += term.factor * values[term.dof];
        displacement.push_back(sum);
      }
    check(VecRestoreArrayRead(whole_, &values));
    return displacement;
  }

private:
  const Model& nodes_;
  Owned<VecScatter> scatter_;
  Owned<Vec> whole_;
};

/// Reactions of the equilibrium at the nodes of the pairs. Those of a pair are at its own node, and by their weights
/// at the nodes of the other side. Either side has the sum of all.
void write_contact(Hdf5File& file, const Equilibrium& equilibrium, const Model& nodes, Layout& layout)
{
  const PairView reactions(equilibrium.reactions, equilibrium.directions);
  const std::vector<ContactPair>& pairs = nodes.interface.geometry;
  if (pairs.empty() || reactions.pairs() != pairs.size()) return;
  std::vector<double> normal(nodes.mesh.nodes.size(), 0), friction = normal, area = normal, pressure = normal;
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
  file.write("equilibrium/normal_reaction", {normal.size()}, normal, "N");
  file.write("equilibrium/friction_reaction", {friction.size()}, friction, "N");
  file.write("equilibrium/pressure", {pressure.size()}, pressure, "Pa");
  layout.still.push_back({"contact pressure at equilibrium [Pa]", "equilibrium/pressure", Center::node, 1});
  layout.still.push_back({"normal reaction at equilibrium [N]", "equilibrium/normal_reaction", Center::node, 1});
  layout.still.push_back({"friction at equilibrium [N]", "equilibrium/friction_reaction", Center::node, 1});
}

/// The pairs, one a row, with the reactions and pressures of the equilibrium where there is one.
void write_pairs(Hdf5File& file, const Equilibrium& equilibrium, const Interface& interface)
{
  const std::vector<ContactPair>& pairs = interface.geometry;
  const std::size_t n = pairs.size();
  if (n == 0) return;
  std::vector<int> node, contact;
  std::vector<double> position, normal, first, second, area, reaction, pressure;
  const auto add = [](std::vector<double>& rows, const auto& entries)
  { rows.insert(rows.end(), entries.begin(), entries.end()); };
  const bool is_solved = equilibrium.reactions.size() == interface.size();
  for (std::size_t i = 0; i < n; ++i)
  {
    const ContactPair& pair = pairs[i];
    node.push_back(pair.node);
    contact.push_back(pair.contact);
    add(position, pair.position);
    add(normal, pair.normal);
    add(first, interface.tangents[i][0]);
    add(second, interface.tangents[i][1]);
    area.push_back(pair.area);
    if (!is_solved) continue;
    const PairVector r = PairView(equilibrium.reactions, equilibrium.directions).vector(i);
    add(reaction, r);
    pressure.push_back(pair.area > 0 ? r[0] / pair.area : 0);
  }
  file.write("pairs/node", {n}, node, "index in mesh/nodes, of the slave side");
  file.write("pairs/contact", {n}, contact, "index of the scene's contact");
  file.write("pairs/position", {n, 3}, position, "m");
  file.write("pairs/normal", {n, 3}, normal, "-");
  file.write("pairs/tangent_1", {n, 3}, first, "-");
  file.write("pairs/tangent_2", {n, 3}, second, "-");
  file.write("pairs/area", {n}, area, "m2");
  file.write("pairs/gap", {n}, interface.gap, "m");
  if (!is_solved) return;
  file.write("pairs/reaction", {n, 3}, reaction, "N");
  file.write("pairs/pressure", {n}, pressure, "Pa");
}

std::string data_item(const std::string& data, const std::string& dimensions, const char* type)
{
  return "<DataItem Dimensions=\"" + dimensions + "\" " + type + " Format=\"HDF\">fields.h5:/" + data + "</DataItem>";
}

constexpr const char* integers = "NumberType=\"Int\" Precision=\"4\"";
constexpr const char* reals = "NumberType=\"Float\" Precision=\"8\"";

std::string attribute_text(const Attribute& attribute, const Layout& layout)
{
  const bool vector = attribute.components == 3;
  const bool cell = attribute.center == Center::cell;
  const std::string size = std::to_string(cell ? layout.cells : layout.nodes) + (vector ? " 3" : "");
  return "        <Attribute Name=\"" + attribute.name + "\" AttributeType=\"" + (vector ? "Vector" : "Scalar") +
         "\" Center=\"" + word(attribute.center) + "\">" + data_item(attribute.data, size, cell ? integers : reals) +
         "</Attribute>\n";
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
    for (const Attribute& attribute : layout.still) text << attribute_text(attribute, layout);
    if (!layout.time.empty())
      text << attribute_text({"displacement in the cycle [m]", cycle_data(i), Center::node, 3}, layout);
    text << "      </Grid>\n";
  }
  text << "    </Grid>\n  </Domain>\n</Xdmf>\n";
  return text.str();
}

/// Collective. One nodal vector field into the file of rank 0.
void write_nodal(std::optional<Hdf5File>& file, const Gather& gather, Vec u, const std::string& data,
                 const std::string& unit, MPI_Comm comm)
{
  const std::vector<double> nodal = gather.nodal(u);
  on_rank_zero(comm, [&] { file->write(data, {nodal.size() / 3, 3}, nodal, unit); });
}

void write_modes(std::optional<Hdf5File>& file, const Gather& gather, const Modes& modes, Layout& layout, MPI_Comm comm)
{
  int number = 0;
  for (const ComplexMode& mode : modes.modes)
  {
    const bool grows = is_unstable(mode.lambda);
    if (!grows && modes.shapes == ModeShapes::unstable) continue;
    const std::string data = "modes/" + std::to_string(++number) + "/";
    std::ostringstream name;
    name << (grows ? "unstable mode " : "mode ") << number << ", " << std::lround(mode.frequency_hz()) << " Hz, ";
    write_nodal(file, gather, mode.real, data + "real", "m", comm);
    write_nodal(file, gather, mode.imaginary, data + "imaginary", "m", comm);
    layout.still.push_back({name.str() + "real part", data + "real", Center::node, 3});
    layout.still.push_back({name.str() + "imaginary part", data + "imaginary", Center::node, 3});
  }
}

constexpr Eigen::Index shown_shapes = 6; // of a settled motion in ParaView

void write_motion_shapes(std::optional<Hdf5File>& file, const Gather& gather, const MotionShapes& shapes, Vec like,
                         Layout& layout, MPI_Comm comm)
{
  const Owned<Vec> shape = zeros_like(like);
  for (Eigen::Index i = 0; i < shapes.V.columns(); ++i)
  {
    copy_column(shapes.V, i, shape);
    const std::string number = std::to_string(i + 1), data = "settled/shape_" + number;
    write_nodal(file, gather, shape, data, "kg^-1/2", comm);
    if (i < shown_shapes)
      layout.still.push_back({"shape " + number + " of the settled motion [kg^-1/2]", data, Center::node, 3});
  }
}

/// Samples are spread evenly over the steps of the period and end with its last one [s].
double sample_time(const LimitCycle& cycle, std::size_t sample)
{
  const double steps = cycle.steps_per_period, samples = static_cast<double>(cycle.measured.displacements.size());
  return std::ceil(static_cast<double>(sample + 1) * steps / samples) * cycle.orbit.period / steps;
}

} // namespace

void write_fields(const Report& report, const Scene& scene, const Model& nodes, const std::filesystem::path& output,
                  MPI_Comm comm)
{
  const auto place = output / word(ResultFile::fields), xdmf = output / word(ResultFile::field_places);
  if (scene.matrices) return;
  Layout layout;
  std::optional<Hdf5File> file; // on rank 0
  on_rank_zero(comm,
               [&]
               {
                 write_mesh(file.emplace(place, report.run), nodes.mesh, layout);
                 write_pairs(*file, report.point.equilibrium, nodes.interface);
                 if (!scene.probes.empty())
                   file->write("probes/node", {scene.probes.size()}, probed_nodes(scene.probes, nodes.mesh),
                               "index in mesh/nodes");
               });
  const Gather gather(nodes);
  if (report.point.equilibrium.u.get())
  {
    write_nodal(file, gather, report.point.equilibrium.u, "equilibrium/displacement", "m", comm);
    layout.still.push_back({"displacement at equilibrium [m]", "equilibrium/displacement", Center::node, 3});
    on_rank_zero(comm, [&] { write_contact(*file, report.point.equilibrium, nodes, layout); });
  }
  write_modes(file, gather, report.point.modes, layout, comm);
  on_rank_zero(comm,
               [&]
               {
                 for (int number = 0; const ModeCauses& causes : report.sensitivity.modes)
                   file->write("modes/" + std::to_string(++number) + "/pair_power", {causes.pair_powers.size()},
                               causes.pair_powers, "1/s");
               });
  if (has_run(report.motion.settled.outcome))
    write_motion_shapes(file, gather, report.motion.settled.shapes, nodes.structure.load, layout, comm);
  const auto& samples = report.motion.cycle.measured.displacements;
  for (std::size_t i = 0; i < samples.size(); ++i)
  {
    write_nodal(file, gather, samples[i], cycle_data(i), "m", comm);
    layout.time.push_back(sample_time(report.motion.cycle, i));
  }
  on_rank_zero(comm,
               [&]
               {
                 file->keep();
                 write_whole_file(xdmf, xdmf_text(layout, report.run));
               });
}

} // namespace squeal
