/// Contact pairs: one a node of the slave surface, by dual multipliers on the part of it that the master surface
/// covers.
///
/// Caveat: the direction of projection is that of the undeformed slave surface, so that sliding is small.
#include "squeal/mesh/contact_pairs.hpp"

#include "dual_rows.hpp"
#include "squeal/base/error.hpp"
#include "squeal/mesh/frames.hpp"
#include "squeal/mesh/row_motions.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace squeal
{

namespace
{

std::string text_of(const Vec3& x)
{
  return format("(%g, %g, %g)", x[0], x[1], x[2]);
}

std::string name_of(const Contact& contact)
{
  return "contact of '" + contact.rotor + "' and '" + contact.stator + "': ";
}

/// Directions in which supports or rigid bodies hold a node or tie it to others, each square to those before it.
using HeldMotions = std::map<int, std::vector<Vec3>>;

void hold(std::vector<Vec3>& held, Vec3 direction)
{
  for (const Vec3& other : held) direction = direction - dot(direction, other) * other;
  if (const double rest = norm(direction); rest > 1e-6) held.push_back((1 / rest) * direction);
}

HeldMotions held_motions(const Mesh& mesh, const Scene& scene)
{
  HeldMotions held;
  for (const Support& support : scene.supports)
    for (const int node : named_nodes(mesh, support.on, "support"))
    {
      const Eigen::Matrix3d axes = axes_at(support.frame, mesh.nodes[node], "support on " + support.on);
      for (int c = 0; c < 3; ++c)
        if (support.fixed[static_cast<std::size_t>(c)]) hold(held[node], {axes(0, c), axes(1, c), axes(2, c)});
    }
  for (const RigidBody& body : scene.rigid_bodies)
    for (const std::string& surface : body.surfaces)
      for (const int node : named_nodes(mesh, surface, "rigid body " + body.name))
        for (std::size_t c = 0; c < 3; ++c)
          if (body.motions[c]) hold(held[node], {c == 0 ? 1. : 0., c == 1 ? 1. : 0., c == 2 ? 1. : 0.});
  return held;
}

/// One contact of two surfaces.
struct SurfaceContact
{
  const Mesh& mesh;
  const Contact& contact;
  ContactSurface slave, master;

  bool stator_is_slave() const { return contact.slave == SlaveSide::stator; }
  double size() const { return std::max(slave.size, master.size); }

  /// The pair's normal at a slave node, out of the rotor into the stator.
  Vec3 normal(std::size_t i) const
  {
    if (contact.normal) return *contact.normal;
    return (stator_is_slave() ? -1. : 1.) * slave.normals[i];
  }
};

OverlapLimits limits_of(const SurfaceContact& c)
{
  constexpr double coincident = 1e-6; // of the surfaces' size: places in a mesh file have as many digits
  OverlapLimits limits{c.contact.reach, coincident * c.size(), c.contact.reach == 0, Eigen::Vector3d::Zero()};
  if (c.contact.normal) limits.along = (c.stator_is_slave() ? -1. : 1.) * Eigen::Vector3d(c.contact.normal->data());
  return limits;
}

/// Shells' faces may look to either side. Those of one surface are turned to oppose the other, the stator's first.
void turn_shells(SurfaceContact& c)
{
  ContactSurface &rotor = c.stator_is_slave() ? c.master : c.slave, &stator = c.stator_is_slave() ? c.slave : c.master;
  if (!turn_shell(stator, rotor)) (void)turn_shell(rotor, stator);
}

[[noreturn]] void fail_inside(const SurfaceContact& c, double depth, const Vec3& at)
{
  throw Error(name_of(c.contact) + format("the stator is %.4g m inside the rotor at ", depth) + text_of(at) +
              ": correct the mesh, or the normal, which points out of the rotor");
}

/// Throws Error for surfaces that do not meet or that penetrate each other.
void check_meeting(const SurfaceContact& c, const SlaveRows& rows)
{
  const OverlapFindings& findings = rows.findings;
  if (findings.deepest > 0) fail_inside(c, findings.deepest, findings.deepest_at);
  if (rows.meet()) return;
  const std::string surfaces = name_of(c.contact);
  if (findings.nearest < 0) fail_inside(c, -findings.nearest, findings.nearest_at);
  if (findings.nearest > 0)
    throw Error(surfaces + format("the surfaces are at least %.4g m apart along the normal, at ", findings.nearest) +
                text_of(findings.nearest_at) + ": give the contact a reach above that, or correct the mesh");
  if (findings.same_way && c.contact.normal)
    throw Error(surfaces + "'" + c.slave.name + "' looks away from '" + c.master.name + "' along the given normal at " +
                text_of(findings.same_way_at) + ": the normal points out of the rotor into the stator, turn it");
  if (findings.same_way)
    throw Error(surfaces + "both surfaces look the same way at " + text_of(findings.same_way_at) +
                ": name the faces that look at each other");
  throw Error(surfaces + "no face of one is opposite a face of the other: correct the names or the mesh");
}

/// Whether supports and rigid bodies hold a node along its normal.
bool is_held(const HeldMotions& held, int node, const Vec3& normal)
{
  constexpr double most = 0.99; // share of the normal's square: what is left is a poor pivot
  const auto motions = held.find(node);
  if (motions == held.end()) return false;
  double share = 0;
  for (const Vec3& direction : motions->second) share += dot(direction, normal) * dot(direction, normal);
  return share > most;
}

/// The rows of light and of held nodes go to neighbours. A held node whose row reads one master node keeps it, as on
/// matching meshes.
void give_up_rows(const SurfaceContact& c, const HeldMotions& held_motions, SlaveRows& rows)
{
  constexpr double light = 0.1; // of the area of an uncovered slave surface
  std::vector<RowFate> fate(c.slave.nodes.size(), RowFate::kept);
  std::vector<char> held(fate.size(), 0);
  for (std::size_t i = 0; i < fate.size(); ++i)
  {
    const SlaveRow& row = rows.rows[i];
    if (!row.is_covered()) continue;
    held[i] = is_held(held_motions, c.slave.nodes[i], c.normal(i));
    const auto reads = std::count_if(row.master.begin(), row.master.end(),
                                     [&](const PairNode& m) { return std::abs(m.weight) > 1e-9 * row.whole; });
    if (row.area < light * row.whole || (held[i] && reads > 1))
      fate[i] = RowFate::given_up;
    else if (held[i])
      fate[i] = RowFate::kept_own;
  }
  for (const std::size_t i : hand_over(c.slave, c.mesh.nodes, fate, rows))
    if (held[i])
      throw Error(name_of(c.contact) + "a support or a rigid body holds '" + c.slave.name +
                  "' along its normal around " + node_text(c.slave.nodes[i], c.mesh.nodes[c.slave.nodes[i]]) +
                  ", so it cannot follow the other side: set slave = \"" + (c.stator_is_slave() ? "rotor" : "stator") +
                  "\"");
}

/// Divides by the area and drops weights that are rounding. The largest one takes what they add up to, so that a
/// common translation leaves the gap as it is.
std::vector<PairNode> normalised(const std::vector<PairNode>& weighted, double area)
{
  constexpr double rounding = 1e-13;
  std::vector<PairNode> nodes;
  double left = 1;
  std::size_t largest = 0;
  for (const auto& [node, weight] : weighted)
  {
    if (std::abs(weight) <= rounding * area) continue;
    nodes.push_back({node, weight / area});
    left -= nodes.back().weight;
    if (nodes.back().weight > nodes[largest].weight) largest = nodes.size() - 1;
  }
  nodes[largest].weight += left;
  return nodes;
}

int heaviest(const std::vector<PairNode>& nodes)
{
  return std::max_element(nodes.begin(), nodes.end(),
                          [](const PairNode& a, const PairNode& b) { return a.weight < b.weight; })
      ->node;
}

Vec3 mean_place(const std::vector<PairNode>& nodes, const std::vector<Vec3>& x)
{
  Vec3 sum{};
  for (const auto& [node, weight] : nodes) sum = sum + weight * x[node];
  return sum;
}

ContactPair pair_of(const SurfaceContact& c, std::size_t i, const SlaveRow& row, Coverage& coverage)
{
  std::vector<PairNode> own = normalised(row.slave, row.area), other = normalised(row.master, row.area);
  auto &rotor = c.stator_is_slave() ? other : own, &stator = c.stator_is_slave() ? own : other;
  ContactPair pair;
  pair.node = c.slave.nodes[i];
  pair.slave_nodes = static_cast<int>(own.size());
  (c.stator_is_slave() ? pair.stator_node : pair.rotor_node) = pair.node;
  (c.stator_is_slave() ? pair.rotor_node : pair.stator_node) = heaviest(other);
  pair.position = mean_place(rotor, c.mesh.nodes);
  pair.normal = c.normal(i);
  pair.area = row.area;
  const Vec3 apart = mean_place(stator, c.mesh.nodes) - pair.position;
  const double distance = dot(apart, pair.normal);
  coverage.offset = std::max(coverage.offset, norm(apart - distance * pair.normal));
  if (c.contact.reach > 0)
    pair.gap = std::abs(distance) <= 1e-6 * c.contact.reach && distance < 0 ? 0 : distance;
  else
    coverage.closed = std::max(coverage.closed, std::abs(distance));
  const double own_sign = c.stator_is_slave() ? 1 : -1;
  for (const auto& [node, weight] : own) pair.nodes.push_back({node, own_sign * weight});
  for (const auto& [node, weight] : other) pair.nodes.push_back({node, -own_sign * weight});
  return pair;
}

void add_surface_pairs(const Mesh& mesh, const Scene& scene, int index, ContactPairs& result)
{
  const Contact& contact = scene.contacts[index];
  const ContactSurface rotor = contact_surface(mesh, contact.rotor, "contact"),
                       stator = contact_surface(mesh, contact.stator, "contact");
  const bool stator_is_slave = contact.slave == SlaveSide::stator;
  SurfaceContact c{mesh, contact, stator_is_slave ? stator : rotor, stator_is_slave ? rotor : stator};
  if (const std::string shared = share_text(c.slave, c.master); !shared.empty())
    throw Error("contact surfaces '" + contact.rotor + "' and '" + contact.stator + "' " + shared +
                ": give each body its own copy of the surface and its nodes");
  turn_shells(c);
  SlaveRows rows = dual_rows(c.slave, c.master, limits_of(c));
  check_meeting(c, rows);
  give_up_rows(c, held_motions(mesh, scene), rows);
  Coverage& coverage = result.coverage.emplace_back(rows.coverage);
  std::vector<ContactPair> pairs;
  for (std::size_t i = 0; i < rows.rows.size(); ++i)
    if (rows.rows[i].area > 0)
    {
      pairs.push_back(pair_of(c, i, rows.rows[i], coverage));
      pairs.back().contact = index;
    }
  std::sort(pairs.begin(), pairs.end(),
            [](const ContactPair& a, const ContactPair& b)
            { return std::pair(a.rotor_node, a.stator_node) < std::pair(b.rotor_node, b.stator_node); });
  std::move(pairs.begin(), pairs.end(), std::back_inserter(result.pairs));
}

/// Adds the gaps of a contact's file to its pairs. Throws Error for a slave node that has none there.
void add_given_gaps(const Mesh& mesh, const Contact& contact, std::span<ContactPair> pairs)
{
  if (contact.gap_file.empty()) return;
  const std::vector<PlacedGap> gaps = read_gaps(contact.gap_file);
  const double near = 1e-6 * diagonal_of(mesh.nodes);
  for (ContactPair& pair : pairs)
  {
    const Vec3& at = mesh.nodes[static_cast<std::size_t>(pair.node)];
    const auto found = std::ranges::find_if(gaps, [&](const PlacedGap& gap) { return norm(gap.at - at) <= near; });
    if (found == gaps.end())
      throw Error(name_of(contact) + contact.gap_file.string() + " has no line for " + node_text(pair.node, at) +
                  " of the slave side");
    pair.gap += found->gap;
  }
}

} // namespace

ContactPairs make_pairs(const Mesh& mesh, const Scene& scene)
{
  ContactPairs result;
  for (std::size_t i = 0; i < scene.contacts.size(); ++i)
  {
    const Contact& contact = scene.contacts[i];
    const std::size_t first = result.pairs.size();
    const auto rotor = mesh.points.find(contact.rotor), stator = mesh.points.find(contact.stator);
    if ((rotor == mesh.points.end()) != (stator == mesh.points.end()))
      throw Error(name_of(contact) + "one is a point and the other is not; name two points or two surfaces");
    if (rotor == mesh.points.end())
      add_surface_pairs(mesh, scene, static_cast<int>(i), result);
    else if (!contact.normal)
      throw Error(name_of(contact) + "two points need a normal");
    else
    {
      const int a = rotor->second, b = stator->second;
      result.coverage.emplace_back();
      const Vec3 normal = (1 / norm(*contact.normal)) * *contact.normal;
      result.pairs.push_back({a, b, b, mesh.nodes[a], normal, 0, static_cast<int>(i), 0, {{b, 1}, {a, -1}}, 1});
    }
    add_given_gaps(mesh, contact, std::span(result.pairs).subspan(first));
  }
  return result;
}

} // namespace squeal
