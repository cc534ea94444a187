#include "face_overlap.hpp"

#include "squeal/base/error.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <algorithm>
#include <boost/geometry.hpp>
#include <boost/geometry/index/rtree.hpp>
#include <cmath>
#include <map>
#include <ranges>
#include <set>

namespace squeal
{

namespace
{

namespace geometry = boost::geometry;
using Corner = geometry::model::point<double, 3, geometry::cs::cartesian>;
using Box = geometry::model::box<Corner>;

Vec3 vec3(const Eigen::Vector3d& v)
{
  return {v(0), v(1), v(2)};
}

std::vector<int> nodes_of_faces(const std::vector<Face>& faces)
{
  std::set<int> nodes;
  for (const Face& face : faces) nodes.insert(nodes_of(face).begin(), nodes_of(face).end());
  return {nodes.begin(), nodes.end()};
}

/// int chi_i n dA of each node of a face [m2].
Eigen::Matrix<double, 3, Eigen::Dynamic> multiplier_vectors(const Face& face, std::span<const Vec3> x)
{
  const std::vector<Vec3> weights = face_weights(face.shape, x);
  return position_matrix(weights) * multiplier_factors(face.shape).transpose();
}

/// A face beside an edge, and whether it goes along it from the lower node to the higher one.
struct EdgeFace
{
  std::size_t face = 0;
  bool upwards = false;
};

using EdgeFaces = std::map<std::pair<int, int>, std::vector<EdgeFace>>;

EdgeFaces edges_of(const std::vector<Face>& faces)
{
  EdgeFaces edges;
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (int i = 0, corners = corner_count(faces[f].shape); i < corners; ++i)
    {
      const int from = faces[f].nodes[i], to = faces[f].nodes[(i + 1) % corners];
      edges[std::minmax(from, to)].push_back({f, from < to});
    }
  return edges;
}

/// Sets the patches. Returns the side of each face: of a solid's 1. Shells may be numbered one way and their neighbours
/// the other; in a patch all have the side of the first one.
std::vector<double> set_patches(ContactSurface& surface)
{
  std::vector<double> side(surface.faces.size(), 1);
  surface.patch.assign(surface.faces.size(), -1);
  const EdgeFaces edges = edges_of(surface.faces);
  int patches = 0;
  for (std::size_t first = 0; first < surface.faces.size(); ++first)
  {
    if (surface.patch[first] >= 0) continue;
    surface.patch[first] = patches;
    std::vector<std::size_t> reached{first};
    while (!reached.empty())
    {
      const std::size_t f = reached.back();
      reached.pop_back();
      const Face& face = surface.faces[f];
      for (int i = 0, corners = corner_count(face.shape); i < corners; ++i)
      {
        const int from = face.nodes[i], to = face.nodes[(i + 1) % corners];
        for (const EdgeFace& next : edges.at(std::minmax(from, to)))
        {
          if (surface.patch[next.face] >= 0) continue;
          surface.patch[next.face] = patches;
          if (surface.placed[next.face].two_sided) side[next.face] = next.upwards == (from < to) ? -side[f] : side[f];
          reached.push_back(next.face);
        }
      }
    }
    ++patches;
  }
  return side;
}

/// Sets the nodes' normals, and how far the chords of linear faces may stand off the surface. An arc that turns by
/// angle between the middle and the end of a chord h is h angle/4 above it. Twice that is allowed.
void set_normals(ContactSurface& surface, const std::vector<double>& side)
{
  std::vector<Vec3> sum(surface.nodes.size(), Vec3{});
  for (std::size_t f = 0; f < surface.faces.size(); ++f)
  {
    const auto nodes = nodes_of(surface.faces[f]);
    std::vector<Vec3> x;
    for (Eigen::Index i = 0; i < surface.placed[f].x.cols(); ++i) x.push_back(vec3(surface.placed[f].x.col(i)));
    const auto vectors = (side[f] * multiplier_vectors(surface.faces[f], x)).eval();
    surface.placed[f].normal = vectors.rowwise().sum().normalized();
    for (std::size_t i = 0; i < nodes.size(); ++i)
    {
      Vec3& s = sum[surface.place_of(nodes[i])];
      s = s + vec3(vectors.col(static_cast<Eigen::Index>(i)));
    }
  }
  for (const Vec3& s : sum) surface.normals.push_back((1 / norm(s)) * s);
  for (std::size_t f = 0; f < surface.faces.size(); ++f)
  {
    PlacedFace& face = surface.placed[f];
    double angle = 0, size = 0;
    for (const int node : nodes_of(surface.faces[f]))
      angle = std::max(angle, norm(surface.normals[surface.place_of(node)] - vec3(face.normal)));
    for (Eigen::Index i = 0; i < face.x.cols(); ++i)
      size = std::max(size, (face.x.colwise() - face.x.col(i)).colwise().norm().maxCoeff());
    face.slack = 0.5 * size * angle;
  }
}

Box box_of(const PlacedFace& face, double margin)
{
  const Eigen::Vector3d low = face.x.rowwise().minCoeff().array() - margin;
  const Eigen::Vector3d high = face.x.rowwise().maxCoeff().array() + margin;
  return {Corner(low(0), low(1), low(2)), Corner(high(0), high(1), high(2))};
}

/// Faces by their boxes.
using FaceTree = geometry::index::rtree<std::pair<Box, int>, geometry::index::quadratic<16>>;

FaceTree tree_of(const std::vector<PlacedFace>& faces)
{
  std::vector<std::pair<Box, int>> boxes;
  for (const PlacedFace& face : faces) boxes.emplace_back(box_of(face, 0), static_cast<int>(boxes.size()));
  return {boxes.begin(), boxes.end()};
}

/// The faces whose boxes come within `margin` of this face's, ascending.
std::vector<int> near(const FaceTree& tree, const PlacedFace& face, double margin)
{
  std::vector<int> found;
  for (auto it = tree.qbegin(geometry::index::intersects(box_of(face, margin))); it != tree.qend(); ++it)
    found.push_back(it->second);
  std::sort(found.begin(), found.end());
  return found;
}

/// Adds up the weights of each node.
void merge(std::vector<PairNode>& nodes)
{
  std::stable_sort(nodes.begin(), nodes.end(), [](const PairNode& a, const PairNode& b) { return a.node < b.node; });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (kept > 0 && nodes[kept - 1].node == nodes[i].node)
      nodes[kept - 1].weight += nodes[i].weight;
    else
      nodes[kept++] = nodes[i];
  nodes.resize(kept);
}

/// Adds what a covered face gives to the rows of its nodes: area, and D_e M_e^-1 int chi N_j for the master nodes.
void add_face(const CoveredFace& covered, std::span<SlaveRow* const> rows, const ContactSurface& master)
{
  const Eigen::LDLT<FaceMatrix> gram(covered.gram);
  for (const auto& [face, coupling] : covered.masters)
  {
    const FaceMatrix weights = covered.area.asDiagonal() * gram.solve(coupling);
    const auto nodes = nodes_of(master.faces[static_cast<std::size_t>(face)]);
    for (std::size_t i = 0; i < rows.size(); ++i)
      for (std::size_t j = 0; j < nodes.size(); ++j)
        rows[i]->master.push_back({nodes[j], weights(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j))});
  }
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i]->area += covered.area(static_cast<Eigen::Index>(i));
}

/// Sets the slave part: what the multipliers' functions weigh the nodes' motions by, u = sum chi_i (T^-1)_ji u_j. Of a
/// corner that is the node itself, of a mid-side twice the node less half of each end of its side.
void set_slave_parts(const ContactSurface& slave, std::vector<SlaveRow>& rows)
{
  for (const Face& face : slave.faces)
  {
    const FaceMatrix inverse = multiplier_factors(face.shape).inverse();
    for (Eigen::Index i = 0; i < inverse.cols(); ++i)
    {
      SlaveRow& row = rows[slave.place_of(face.nodes[i])];
      row.slave = {{face.nodes[i], inverse(i, i) * row.area}};
      for (Eigen::Index j = 0; j < i; ++j) // the factors are triangular
        if (inverse(j, i) != 0) row.slave.push_back({face.nodes[j], inverse(j, i) * row.area});
    }
  }
}

void check_single_cover(const CoveredFace& covered, const Face& face, const ContactSurface& slave,
                        const ContactSurface& master)
{
  if (covered.area.sum() <= (1 + 1e-6) * covered.whole.sum()) return;
  const std::size_t f = &face - slave.faces.data();
  throw Error("contact surface '" + master.name + "' has faces above each other at " +
              node_text(face.nodes[0], vec3(slave.placed[f].x.col(0))) +
              ": name only the faces that the other surface touches, or lower the contact's reach");
}

} // namespace

std::size_t ContactSurface::place_of(int node) const
{
  return static_cast<std::size_t>(std::lower_bound(nodes.begin(), nodes.end(), node) - nodes.begin());
}

ContactSurface contact_surface(const Mesh& mesh, const std::string& name, const std::string& user)
{
  ContactSurface surface{name, named_faces(mesh, name, user), {}, {}, {}, {}, 0};
  surface.nodes = nodes_of_faces(surface.faces);
  for (const Face& face : surface.faces)
  {
    surface.placed.push_back(
        {.shape = face.shape, .x = position_matrix(positions_of(mesh, nodes_of(face))), .two_sided = face.of_shell});
  }
  set_normals(surface, set_patches(surface));
  surface.size = diagonal_of(positions_of(mesh, surface.nodes));
  return surface;
}

bool turn_shell(ContactSurface& turned, const ContactSurface& other)
{
  if (!turned.placed.front().two_sided) return false;
  std::vector<char> turns; // of each patch, by its first face
  std::vector<char> node_turns(turned.nodes.size(), 0);
  for (std::size_t f = 0; f < turned.placed.size(); ++f)
  {
    PlacedFace& face = turned.placed[f];
    const auto patch = static_cast<std::size_t>(turned.patch[f]);
    if (patch == turns.size())
    {
      const Eigen::Vector3d at = face.x.rowwise().mean();
      const auto distance = [&](const PlacedFace& x) { return (x.x.rowwise().mean() - at).norm(); };
      const auto near = std::min_element(other.placed.begin(), other.placed.end(),
                                         [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
      turns.push_back(near->normal.dot(face.normal) >= 0);
    }
    if (!turns[patch]) continue;
    face.normal = -face.normal;
    for (const int node : nodes_of(turned.faces[f])) node_turns[turned.place_of(node)] = 1;
  }
  for (std::size_t i = 0; i < node_turns.size(); ++i)
    if (node_turns[i]) turned.normals[i] = -1 * turned.normals[i];
  return true;
}

namespace
{

SlaveRows covered_rows(const ContactSurface& slave, const ContactSurface& master, const OverlapLimits& limits)
{
  constexpr double sliver = 1e-8; // share of a face: the rounding of its inverse Gram matrix is 1e-16 over this share
  const FaceTree tree = tree_of(master.placed);
  double slack = limits.rounding;
  for (const PlacedFace& face : master.placed) slack = std::max(slack, limits.rounding + face.slack);
  SlaveRows result{std::vector<SlaveRow>(slave.nodes.size()), std::vector<char>(slave.faces.size(), 0), {}, {}};
  double most_uncovered = 0;
  for (std::size_t f = 0; f < slave.faces.size(); ++f)
  {
    const PlacedFace& face = slave.placed[f];
    const double margin = std::max(limits.search, limits.closes ? slack + face.slack : limits.distance);
    const CoveredFace covered = cover_face(face, master.placed, near(tree, face, margin), limits, result.findings);
    check_single_cover(covered, slave.faces[f], slave, master);
    std::vector<SlaveRow*> rows;
    for (const int node : nodes_of(slave.faces[f])) rows.push_back(&result.rows[slave.place_of(node)]);
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i]->whole += covered.whole(static_cast<Eigen::Index>(i));
    const double area = covered.area.sum(), whole = covered.whole.sum();
    result.coverage.area += whole;
    result.coverage.covered += area;
    if (whole - area > most_uncovered)
      most_uncovered = whole - area, result.coverage.uncovered_at = vec3(face.x.rowwise().mean());
    if (area < sliver * whole) continue;
    result.covered[f] = 1;
    add_face(covered, rows, master);
  }
  set_slave_parts(slave, result.rows);
  for (SlaveRow& row : result.rows) merge(row.master);
  return result;
}

} // namespace

SlaveRows dual_rows(const ContactSurface& slave, const ContactSurface& master, const OverlapLimits& limits)
{
  SlaveRows rows = covered_rows(slave, master, limits);
  if (rows.meet()) return rows;
  OverlapLimits wide = limits;
  wide.search = std::max(slave.size, master.size);
  return covered_rows(slave, master, wide);
}

std::string share_text(const ContactSurface& a, const ContactSurface& b)
{
  std::vector<int> shared;
  std::ranges::set_intersection(a.nodes, b.nodes, std::back_inserter(shared));
  return shared.empty() ? "" : "share " + std::to_string(shared.size()) + " nodes, so that the bodies are joined there";
}

std::vector<std::size_t> hand_over(const ContactSurface& slave, const std::vector<Vec3>& x,
                                   const std::vector<RowFate>& fate, SlaveRows& rows)
{
  std::vector<std::set<std::size_t>> takers(slave.nodes.size());
  for (std::size_t f = 0; f < slave.faces.size(); ++f)
    for (const int giver : nodes_of(slave.faces[f]))
      if (const std::size_t d = slave.place_of(giver); rows.covered[f] && fate[d] == RowFate::given_up)
        for (const int taker : nodes_of(slave.faces[f]))
          if (const std::size_t k = slave.place_of(taker); fate[k] == RowFate::kept && rows.rows[k].is_covered())
            takers[d].insert(k);
  std::vector<std::size_t> alone;
  for (std::size_t d = 0; d < takers.size(); ++d)
  {
    if (fate[d] != RowFate::given_up || !rows.rows[d].is_covered()) continue;
    std::set<std::size_t>& near = takers[d];
    if (near.empty())
    {
      alone.push_back(d);
      continue;
    }
    const auto distance = [&](std::size_t k) { return norm(x[slave.nodes[k]] - x[slave.nodes[d]]); };
    const double least = std::ranges::min(near | std::views::transform(distance));
    std::erase_if(near, [&](std::size_t k) { return distance(k) > 1.01 * least; });
    const double share = 1 / static_cast<double>(near.size());
    const SlaveRow& given = rows.rows[d];
    for (const std::size_t k : near)
    {
      SlaveRow& row = rows.rows[k];
      row.area += share * given.area;
      for (const auto& [node, weight] : given.slave) row.slave.push_back({node, share * weight});
      for (const auto& [node, weight] : given.master) row.master.push_back({node, share * weight});
      merge(row.slave);
      merge(row.master);
    }
  }
  for (std::size_t d = 0; d < fate.size(); ++d)
    if (fate[d] == RowFate::given_up && !std::binary_search(alone.begin(), alone.end(), d)) rows.rows[d].area = 0;
  return alone;
}

} // namespace squeal
