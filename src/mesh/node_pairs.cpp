/// Contact pairs: coincident nodes of two surfaces with matching meshes, their normals and tributary areas.
///
/// The vector area of node i is the sum of the integrals of N_i n dA over the faces of the rotor's surface. Its
/// direction is the pair's normal; the sum of the lengths is the pair's area. All weights of 3-, 4- and 9-node faces
/// are positive. Those of 6-node triangles and 8-node quadrilaterals are zero or negative at the corners, which no
/// unilateral nodal reaction can balance.
#include "squeal/mesh/node_pairs.hpp"

#include "squeal/base/error.hpp"
#include "squeal/mesh/names.hpp"
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/mesh/shapes.hpp"

#include <algorithm>
#include <limits>
#include <sstream>

namespace squeal
{

namespace
{

/// Returns the faces of a contact surface. Throws Error if it is missing or has nodal weights that are not positive.
const std::vector<Face>& contact_surface(const Mesh& mesh, const std::string& name)
{
  const std::vector<Face>& faces = named_faces(mesh, name, "contact");
  for (const Face& face : faces)
    if (face.shape == FaceShape::triangle6 || face.shape == FaceShape::quad8)
      throw Error("contact surface '" + name + "' has " + std::to_string(node_count(face.shape)) +
                  "-node faces, whose consistent nodal forces are not all positive: node-to-node contact needs 3-, 4- "
                  "or 9-node faces. Mesh the bodies in contact with linear elements");
  return faces;
}

/// The nodes of a surface in ascending order.
std::vector<int> surface_nodes(const std::vector<Face>& faces)
{
  std::vector<int> nodes;
  for (const Face& face : faces) nodes.insert(nodes.end(), nodes_of(face).begin(), nodes_of(face).end());
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

/// Diagonal of the bounding box of some nodes [m].
double bounding_diagonal(const std::vector<int>& nodes, const std::vector<Vec3>& x)
{
  Vec3 low = x[nodes.front()], high = low;
  for (const int node : nodes)
    for (int k = 0; k < 3; ++k)
    {
      low[k] = std::min(low[k], x[node][k]);
      high[k] = std::max(high[k], x[node][k]);
    }
  return norm(high - low);
}

/// Nearest-node search in a set of nodes sorted by x.
class NearestNode
{
public:
  NearestNode(std::vector<int> nodes, const std::vector<Vec3>& x) : nodes_(std::move(nodes)), x_(x)
  {
    std::sort(nodes_.begin(), nodes_.end(), [&](int a, int b) { return x_[a] < x_[b]; });
  }

  /// Returns the nearest node and its distance [m].
  std::pair<int, double> to(const Vec3& position) const
  {
    const auto start =
        std::lower_bound(nodes_.begin(), nodes_.end(), position[0], [&](int n, double v) { return x_[n][0] < v; });
    int best = -1;
    double least = std::numeric_limits<double>::infinity();
    const auto may_be_nearer = [&](int node)
    {
      if (std::abs(x_[node][0] - position[0]) > least) return false;
      const double distance = norm(x_[node] - position);
      if (distance < least) least = distance, best = node;
      return true;
    };
    auto upward = start, downward = start;
    while (upward != nodes_.end() && may_be_nearer(*upward)) ++upward;
    while (downward != nodes_.begin() && may_be_nearer(*(downward - 1))) --downward;
    return {best, least};
  }

private:
  std::vector<int> nodes_;
  const std::vector<Vec3>& x_;
};

/// The nodes of one of two surfaces that are matched.
struct ContactSide
{
  const std::string& name;
  std::vector<int> nodes; // ascending
};

/// Returns the coincident node on `other` of each node on `side`. Throws Error if there is none.
std::vector<int> coincident_nodes(const ContactSide& side, const ContactSide& other, const std::vector<Vec3>& x)
{
  const double tolerance = 1e-6 * std::max(bounding_diagonal(side.nodes, x), bounding_diagonal(other.nodes, x));
  const NearestNode nearest(other.nodes, x);
  std::vector<int> found;
  int unmatched = 0, farthest = -1;
  double largest = 0;
  for (const int node : side.nodes)
  {
    const auto [partner, distance] = nearest.to(x[node]);
    found.push_back(partner);
    if (distance <= tolerance) continue;
    ++unmatched;
    if (distance > largest) largest = distance, farthest = node;
  }
  if (!unmatched) return found;
  std::ostringstream text;
  text << "contact surfaces '" << side.name << "' and '" << other.name << "' do not match: " << unmatched << " of the "
       << side.nodes.size() << " nodes of '" << side.name << "' have no partner within " << tolerance
       << " m; the farthest is " << largest << " m away, from (" << x[farthest][0] << ", " << x[farthest][1] << ", "
       << x[farthest][2] << "). Give both surfaces the same nodes in the same places";
  throw Error(text.str());
}

/// Returns the positions at which nodes are compared: with a reach, projected along the normal.
std::vector<Vec3> compared_positions(const Mesh& mesh, const Contact& contact)
{
  std::vector<Vec3> x = mesh.nodes;
  if (contact.reach > 0)
    for (Vec3& position : x) position = position - dot(position, *contact.normal) * *contact.normal;
  return x;
}

/// Returns the distance of two partners along the normal [m]. Throws Error if it is negative or beyond the reach.
double normal_distance(const Mesh& mesh, const Contact& contact, int a, int b)
{
  if (contact.reach == 0) return 0;
  const double distance = dot(mesh.nodes[b] - mesh.nodes[a], *contact.normal);
  if (distance >= -1e-6 * contact.reach && distance <= contact.reach) return std::max(0., distance);
  std::ostringstream text;
  text << "contact surfaces '" << contact.rotor << "' and '" << contact.stator << "': partners at (" << mesh.nodes[a][0]
       << ", " << mesh.nodes[a][1] << ", " << mesh.nodes[a][2] << ") are " << distance << " m apart along the normal, "
       << (distance < 0 ? "the stator inside the rotor: turn the normal or correct the mesh"
                        : "farther than the contact's reach: raise it or make the surfaces smaller");
  throw Error(text.str());
}

struct NodalArea
{
  Vec3 vector{};     // [m2] sum of the integrals of N_i n dA
  double scalar = 0; // [m2] sum of their lengths
};

std::map<int, NodalArea> nodal_areas(const std::vector<Face>& faces, const std::vector<Vec3>& nodes)
{
  std::map<int, NodalArea> areas;
  for (const Face& face : faces)
  {
    std::vector<Vec3> x;
    for (const int node : nodes_of(face)) x.push_back(nodes[node]);
    const std::vector<Vec3> weights = face_weights(face.shape, x);
    for (std::size_t i = 0; i < weights.size(); ++i)
    {
      NodalArea& area = areas[face.nodes[i]];
      area.vector = area.vector + weights[i];
      area.scalar += norm(weights[i]);
    }
  }
  return areas;
}

void match_surfaces(const Mesh& mesh, const Contact& contact, int index, std::vector<NodePair>& pairs)
{
  const std::vector<Face>& faces = contact_surface(mesh, contact.rotor);
  const ContactSide rotor{contact.rotor, surface_nodes(faces)},
      stator{contact.stator, surface_nodes(contact_surface(mesh, contact.stator))};
  std::vector<int> shared;
  std::set_intersection(rotor.nodes.begin(), rotor.nodes.end(), stator.nodes.begin(), stator.nodes.end(),
                        std::back_inserter(shared));
  if (!shared.empty())
    throw Error("contact surfaces '" + contact.rotor + "' and '" + contact.stator + "' share " +
                std::to_string(shared.size()) +
                " nodes, so the bodies are joined there: give each body its own copy of the surface and its nodes");
  const std::vector<Vec3> x = compared_positions(mesh, contact);
  const std::vector<int> partners = coincident_nodes(rotor, stator, x);
  coincident_nodes(stator, rotor, x); // refuses a stator with more nodes than the rotor

  const std::map<int, NodalArea> areas = nodal_areas(faces, mesh.nodes);
  for (std::size_t i = 0; i < partners.size(); ++i)
  {
    const int a = rotor.nodes[i], b = partners[i];
    const NodalArea& area = areas.at(a);
    const Vec3 normal = contact.normal ? *contact.normal : area.vector;
    pairs.push_back({a, b, (1 / norm(normal)) * normal, area.scalar, index, normal_distance(mesh, contact, a, b)});
  }
}

} // namespace

std::vector<NodePair> match_pairs(const Mesh& mesh, const std::vector<Contact>& contacts)
{
  std::vector<NodePair> pairs;
  for (std::size_t c = 0; c < contacts.size(); ++c)
  {
    const Contact& contact = contacts[c];
    const auto rotor = mesh.points.find(contact.rotor), stator = mesh.points.find(contact.stator);
    if ((rotor == mesh.points.end()) != (stator == mesh.points.end()))
      throw Error("contact between '" + contact.rotor + "' and '" + contact.stator +
                  "': one is a point and the other is not; name two points or two surfaces");
    if (rotor == mesh.points.end())
    {
      match_surfaces(mesh, contact, static_cast<int>(c), pairs);
      continue;
    }
    if (!contact.normal)
      throw Error("contact between points '" + contact.rotor + "' and '" + contact.stator + "' needs a normal");
    pairs.push_back(
        {rotor->second, stator->second, (1 / norm(*contact.normal)) * *contact.normal, 0, static_cast<int>(c), 0});
  }
  return pairs;
}

} // namespace squeal
