/// Size, masses and warnings of a model, as far as they are known before anything is solved.
#include "squeal/base/constants.hpp"
#include "squeal/mesh/contact_pairs.hpp"
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/model.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Geometry>

namespace squeal
{

namespace
{

/// Says how much of a slave surface does not face its master; nothing where all of it does.
void warn_of_uncovered(const Coverage& c, const std::string& slave, const std::string& master, const char* consequence,
                       std::vector<std::string>& sentences)
{
  constexpr double rounding = 1e-6; // the tolerance of coincident surfaces
  const Vec3& at = c.uncovered_at;
  if (c.covered < (1 - rounding) * c.area)
    sentences.push_back(format("%.3g %% of the area of '%s' does not face '%s', most of it around (%g, %g, %g): %s",
                               100 * (1 - c.covered / c.area), slave.c_str(), master.c_str(), at[0], at[1], at[2],
                               consequence));
}

/// A sentence for each part that contacts or its own spin turn at two rates.
void warn_of_rates(const Model& model, const Scene& scene, std::vector<std::string>& sentences)
{
  std::map<std::string, double> rates;
  for (const Part& part : scene.parts)
    if (part.rotation) rates[part.name] = part.rotation->rate;
  for (const Contact& contact : scene.contacts)
  {
    if (!contact.rotation) continue;
    const std::string part = part_of(scene, model.mesh, contact.rotor);
    const auto known = part.empty() ? rates.end() : rates.try_emplace(part, contact.rotation->rate).first;
    if (known != rates.end() && known->second != contact.rotation->rate)
      sentences.push_back(format("'%s' turns at %g rad/s, and in the contact of '%s' at %g rad/s: one part has one "
                                 "rate, which a [[rotor]] says once",
                                 part.c_str(), known->second, contact.rotor.c_str(), contact.rotation->rate));
  }
}

/// Whether a drive moves a pair along its surface, by more than the rounding of one along the normal.
bool is_driven(const Interface& interface, const Scene& scene)
{
  constexpr double rounding = 1e-9;
  for (std::size_t i = 0; i < static_cast<std::size_t>(interface.pairs); ++i)
  {
    const ContactPair* const pair = interface.geometry.empty() ? nullptr : &interface.geometry[i];
    const Vec3 velocity =
        pair ? drive_velocity(scene.contacts[static_cast<std::size_t>(pair->contact)], pair->position) : Vec3{};
    if (drive_speed(interface, i) > rounding * norm(velocity)) return true;
  }
  return false;
}

/// A sentence for each contact whose drive is not along its surface.
void warn_of_drives(const Interface& interface, const Scene& scene, std::vector<std::string>& sentences)
{
  constexpr double most = 0.2; // along the normal, of the whole: chords of coarse curved faces have less
  std::vector<double> normal(scene.contacts.size()), whole(scene.contacts.size());
  for (const ContactPair& pair : interface.geometry)
  {
    const auto contact = static_cast<std::size_t>(pair.contact);
    const Vec3 velocity = drive_velocity(scene.contacts[contact], pair.position);
    normal[contact] = std::hypot(normal[contact], dot(velocity, pair.normal));
    whole[contact] = std::hypot(whole[contact], norm(velocity));
  }
  for (std::size_t i = 0; i < normal.size(); ++i)
    if (normal[i] > most * whole[i])
      sentences.push_back(
          format("the drive of '%s' has %.0f %% of its speed along the normal of the contact with '%s', "
                 "where nothing slides: is its axis or velocity right?",
                 scene.contacts[i].rotor.c_str(), 100 * normal[i] / whole[i], scene.contacts[i].stator.c_str()));
}

/// Sentences about elements that are too stiff and slave surfaces that face nothing.
std::vector<std::string> warnings_of(const Model& model, const Scene& scene)
{
  std::vector<std::string> sentences;
  if (!scene.ties.empty())
  {
    const TiedNodes tied = tied_nodes(model.mesh, scene);
    for (std::size_t i = 0; i < scene.ties.size(); ++i)
      warn_of_uncovered(tied.coverage[i], scene.ties[i].slave, scene.ties[i].master, "it is not tied there", sentences);
  }
  if (const long count = std::ranges::count(model.mesh.elements, Shape::tet4, &Element::shape); count > 0)
    sentences.push_back(
        format("%ld 4-node tetrahedra are too stiff: set Mesh.ElementOrder = 2 for 10-node ones", count));
  for (std::size_t i = 0; i < model.coverage.size(); ++i)
  {
    const Contact& contact = scene.contacts[i];
    const bool stator_is_slave = contact.slave == SlaveSide::stator;
    warn_of_uncovered(model.coverage[i], stator_is_slave ? contact.stator : contact.rotor,
                      stator_is_slave ? contact.rotor : contact.stator, "no contact force acts there", sentences);
  }
  warn_of_rates(model, scene, sentences);
  warn_of_drives(model.interface, scene, sentences);
  return sentences;
}

/// Sides of the box round all elements [m]. Points are where the scene puts them, whatever its mesh's unit.
Vec3 size_of(const Mesh& mesh)
{
  Eigen::AlignedBox3d box;
  for (const Element& element : mesh.elements)
    for (const int node : nodes_of(element))
      box.extend(Eigen::Vector3d(mesh.nodes[static_cast<std::size_t>(node)].data()));
  Vec3 size{};
  if (!box.isEmpty()) std::copy_n(box.sizes().eval().data(), 3, size.begin());
  return size;
}

/// Volume of a solid [m3], or area of a shell [m2].
double measure_of(const Element& element, const NodePositions& x)
{
  double sum = 0;
  for (const auto& [xi, weight, at] : mass_rule(element.shape))
  {
    const Eigen::Matrix3d J = at.dN * x.transpose();
    sum += weight * (is_shell(element.shape) ? J.row(0).cross(J.row(1)).norm() : J.determinant());
  }
  return sum;
}

/// Masses of the parts that the mesh has.
std::vector<PartMass> masses_of(const Mesh& mesh, const Scene& scene)
{
  std::vector<PartMass> parts;
  for (const Part& part : scene.parts) parts.push_back({part.name});
  for (std::size_t i = 0; i < mesh.elements.size(); ++i)
  {
    const Element& element = mesh.elements[i];
    const auto place = static_cast<std::size_t>(element.part);
    const Part& part = scene.parts[place];
    const NodePositions x = position_matrix(positions_of(mesh, nodes_of(element)));
    parts[place].mass += part.material.density * (is_shell(element.shape) ? part.thickness : 1) *
                         measure_of(element, x + position_matrix(arms_of(mesh, i, part.offset)));
  }
  return parts;
}

} // namespace

ModelSummary summary_of(const Model& model, const Scene& scene, MPI_Comm comm)
{
  ModelSummary summary;
  summary.dofs = row_count(model.structure.K);
  summary.elements = model.structure.elements;
  summary.pairs = model.interface.pairs;
  summary.coverage = model.coverage;
  summary.ranks = ranks_of(comm);
  const auto look = [&]
  {
    summary.warnings = warnings_of(model, scene);
    summary.slides = is_driven(model.interface, scene);
    summary.size = size_of(model.mesh);
    summary.length = std::ranges::max(summary.size);
    summary.parts = masses_of(model.mesh, scene);
  };
  on_rank_zero(comm, look);
  if (const double mass = norm_of(model.structure.M, NORM_1); mass > 0)
    summary.rounding_hz = 1e-6 * std::sqrt(norm_of(model.structure.K, NORM_1) / mass) / two_pi;
  return summary;
}

} // namespace squeal
