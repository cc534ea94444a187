#include "squeal/mesh/ties.hpp"

#include "dual_rows.hpp"
#include "squeal/base/error.hpp"
#include "squeal/mesh/shapes.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace squeal
{

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

void check_meeting(const Tie& tie, const SlaveRows& rows)
{
  if (rows.meet()) return;
  const OverlapFindings& found = rows.findings;
  const Vec3& at = found.nearest_at;
  if (found.nearest != 0)
    throw Error(name_of(tie) + format("the surfaces are at least %.4g m apart along the normal, at (%g, %g, %g): give "
                                      "the tie a reach above that, or correct the mesh",
                                      std::abs(found.nearest), at[0], at[1], at[2]));
  throw Error(name_of(tie) + "no face of one is opposite a face of the other: correct the names or the mesh");
}

/// The row of a slave node solved for its own motion. The weights of the others add up to 1, so that a translation is
/// kept to rounding.
TiedNode solved(const Mesh& mesh, const SlaveRow& row, int node, int tie)
{
  TiedNode result{node, tie, {}};
  double own = 0, sum = 0;
  for (const auto& [other, weight] : row.slave)
    if (other == node)
      own = weight;
    else
      result.others.push_back({other, -weight});
  for (const auto& [other, weight] : row.master)
    if (std::abs(weight) > 1e-13 * row.area) result.others.push_back({other, weight});
  for (PairNode& other : result.others) sum += other.weight /= own;
  const auto largest =
      std::max_element(result.others.begin(), result.others.end(),
                       [](const auto& a, const auto& b) { return std::abs(a.weight) < std::abs(b.weight); });
  largest->weight += 1 - sum;
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
  check_meeting(tie, rows);
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
    for (int i = 0, n = corner_count(element.shape); i < n && is_shell(element.shape); ++i)
      edges.insert(ends_of(element.nodes[i], element.nodes[(i + 1) % n]));
  if (edges.empty()) return;
  std::set<int> found;
  for (const Element& element : mesh.elements)
    for (std::size_t k = 0; const auto& [first, second] : mid_sides(element.shape))
    {
      const int a = element.nodes[first], b = element.nodes[second];
      const int middle = element.nodes[corner_count(element.shape) + k++];
      if (edges.contains(ends_of(a, b)) && found.insert(middle).second)
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
