/// Contact pairs: one a node of the slave surface, by dual multipliers on the part of it that the master surface
/// covers.
///
/// Caveat: the direction of projection is that of the undeformed slave surface, so that sliding is small.
#include "squeal/mesh/contact_pairs.hpp"
#include "face_overlap.hpp"
#include "squeal/base/error.hpp"
#include "squeal/mesh/row_motions.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <algorithm>
#include <cmath>
#include <set>
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
      const std::array<Vec3, 3> axes = axes_at(support.frame, mesh.nodes[node], "support on " + support.on);
      for (std::size_t c = 0; c < 3; ++c)
        if (support.fixed[c]) hold(held[node], axes[c]);
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

/// Says why no face of the surfaces of a contact or tie (`user`) is covered.
[[noreturn]] void fail_apart(const std::string& surfaces, const std::string& user, const OverlapFindings& findings)
{
  if (findings.nearest != 0)
    throw Error(surfaces +
                format("the surfaces are at least %.4g m apart along the normal, at ", std::abs(findings.nearest)) +
                text_of(findings.nearest_at) + ": give the " + user + " a reach above that, or correct the mesh");
  throw Error(surfaces + "no face of one is opposite a face of the other: correct the names or the mesh");
}

/// Throws Error for surfaces that do not meet or that penetrate each other.
void check_meeting(const SurfaceContact& c, const SlaveRows& rows)
{
  const OverlapFindings& findings = rows.findings;
  if (findings.deepest > 0) fail_inside(c, findings.deepest, findings.deepest_at);
  if (rows.meet()) return;
  const std::string surfaces = name_of(c.contact);
  if (findings.nearest < 0) fail_inside(c, -findings.nearest, findings.nearest_at);
  const bool same_way = findings.nearest == 0 && findings.same_way;
  if (same_way && c.contact.normal)
    throw Error(surfaces + "'" + c.slave.name + "' looks away from '" + c.master.name + "' along the given normal at " +
                text_of(findings.same_way_at) + ": the normal points out of the rotor into the stator, turn it");
  if (same_way)
    throw Error(surfaces + "both surfaces look the same way at " + text_of(findings.same_way_at) +
                ": name the faces that look at each other");
  fail_apart(surfaces, "contact", findings);
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

namespace
{

constexpr double light = 0.1, coincident = 1e-6; // as of contact pairs

std::string name_of(const Tie& tie)
{
  return "tie of '" + tie.slave + "' to '" + tie.master + "': ";
}

std::string name_of(const Scene& scene, int tie)
{
  return tie < 0 ? "edge of a shell: " : name_of(scene.ties[static_cast<std::size_t>(tie)]);
}

/// The row of a slave node solved for its own motion. The weights of the others add up to 1, so that a translation is
/// kept to rounding.
TiedNode solved(const Mesh& mesh, const SlaveRow& row, int node, int tie)
{
  double own = 0;
  std::vector<PairNode> others = row.master;
  for (const auto& [other, weight] : row.slave)
    if (other == node)
      own = weight;
    else
      others.push_back({other, -weight});
  TiedNode result{node, tie, normalised(others, own)};
  result.arm = mesh.nodes[node];
  for (const auto& [other, weight] : result.others) result.arm = result.arm - weight * mesh.nodes[other];
  return result;
}

void add_tie(const Mesh& mesh, const Tie& tie, int index, TiedNodes& result)
{
  ContactSurface slave = contact_surface(mesh, tie.slave, "tie"), master = contact_surface(mesh, tie.master, "tie");
  if (const std::string shared = share_text(slave, master); !shared.empty())
    throw Error(name_of(tie) + "the surfaces " + shared + ": take the tie out");
  if (!turn_shell(slave, master) && turn_shell(master, slave) && tie.reach > 0)
    throw Error(name_of(tie) +
                "with a reach the shell must be the slave, whose nodes rotate: exchange slave and master");
  const double rounding = coincident * std::max(slave.size, master.size);
  const OverlapLimits limits{tie.reach, tie.reach == 0 ? rounding : std::max(rounding, tie.reach), tie.reach == 0,
                             Eigen::Vector3d::Zero()};
  const SlaveRows rows = dual_rows(slave, master, limits);
  if (!rows.meet()) fail_apart(name_of(tie), "tie", rows.findings);
  for (std::size_t i = 0; i < rows.rows.size(); ++i)
    if (const SlaveRow& row = rows.rows[i]; row.is_covered() && row.area >= light * row.whole)
      result.nodes.push_back(solved(mesh, row, slave.nodes[i], index));
  result.coverage.push_back(rows.coverage);
}

void add_mid_sides(const Mesh& mesh, TiedNodes& result)
{
  using Ends = std::pair<int, int>; // ascending
  const auto ends_of = [](int a, int b) { return Ends(std::min(a, b), std::max(a, b)); };
  std::set<Ends> edges; // of shells
  for (const Element& element : mesh.elements)
    for (int i = 0, n = node_count(element.shape); n < 5 && i < n && is_shell(element.shape); ++i)
      edges.insert(ends_of(element.nodes[i], element.nodes[(i + 1) % n]));
  if (edges.empty()) return;
  std::set<int> found;
  for (const Element& element : mesh.elements)
    for (std::size_t k = 0; const std::vector<int>& ends : middles_of(element.shape))
    {
      const int a = element.nodes[ends[0]], b = element.nodes[ends[1]];
      const int middle = element.nodes[corner_count(element.shape) + k++];
      if (ends.size() == 2 && edges.contains(ends_of(a, b)) && found.insert(middle).second)
        result.nodes.push_back({middle, -1, {{a, 0.5}, {b, 0.5}}});
    }
}

/// Throws Error for nodes that several ties move, or that one moves and another follows.
void check_order(const Mesh& mesh, const Scene& scene, const TiedNodes& tied)
{
  std::map<int, int> tie_of;
  for (const TiedNode& t : tied.nodes)
    if (const auto [other, is_new] = tie_of.emplace(t.node, t.tie); !is_new)
      throw Error(name_of(scene, t.tie) + node_text(t.node, mesh.nodes[t.node]) + " is a slave of the " +
                  name_of(scene, other->second) + "too: give each tie a slave surface of its own");
  for (const TiedNode& t : tied.nodes)
    for (const PairNode& other : t.others)
      if (const auto found = tie_of.find(other.node);
          found != tie_of.end() && found->second != t.tie && found->second >= 0 && t.tie >= 0)
        throw Error(name_of(scene, t.tie) + node_text(other.node, mesh.nodes[other.node]) +
                    " of its master is a slave of the " + name_of(scene, found->second) +
                    "exchange slave and master of one");
}

} // namespace

TiedNodes tied_nodes(const Mesh& mesh, const Scene& scene)
{
  TiedNodes result;
  for (std::size_t i = 0; i < scene.ties.size(); ++i) add_tie(mesh, scene.ties[i], static_cast<int>(i), result);
  add_mid_sides(mesh, result);
  check_order(mesh, scene, result);
  return result;
}

} // namespace squeal
