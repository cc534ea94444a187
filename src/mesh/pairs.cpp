/// Pairs of coincident nodes of two surfaces of matching meshes, their normals and tributary areas.
///
/// Consistent nodal weights of a 4-node face, integral of N_i n dA: the corner cross products J_i of the bilinear map
/// give c + (J_i - c)/3 with c their mean, exactly, since n dA is linear in each direction. All weights of 3-, 4- and
/// 9-node faces are positive; 6-node triangles and 8-node quads have zero or negative ones, which no unilateral nodal
/// reaction can balance.
#include "squeal/base/error.hpp"
#include "squeal/mesh/shapes.hpp"
#include "squeal/mesh/vector.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <sstream>

namespace squeal
{

namespace
{

std::vector<Vec3> nodal_weights(const Face& face, const std::vector<Vec3>& nodes)
{
  const int corners = corner_count(face.shape);
  const double cell = corners == 3 ? 2 : 4; // reference area over corner Jacobian
  std::vector<Vec3> jacobian;
  Vec3 mean{};
  for (int i = 0; i < corners; ++i)
  {
    const Vec3& x = nodes[face.nodes[i]];
    const Vec3& next = nodes[face.nodes[(i + 1) % corners]];
    const Vec3& last = nodes[face.nodes[(i + corners - 1) % corners]];
    jacobian.push_back((1 / cell) * cross(next - x, last - x));
    mean = mean + (1. / corners) * jacobian.back();
  }
  if (corners == 3) return std::vector<Vec3>(3, (1. / 3) * mean);
  if (face.shape == FaceShape::quad9) // Simpson's weights, exact on a parallelogram
  {
    std::vector<Vec3> weights(9, (4. / 9) * mean);
    std::fill_n(weights.begin(), 4, (1. / 9) * mean);
    weights[8] = (16. / 9) * mean;
    return weights;
  }
  for (Vec3& weight : jacobian) weight = mean + (1. / 3) * (weight - mean);
  return jacobian;
}

const std::vector<Face>& contact_surface(const Mesh& mesh, const std::string& name)
{
  const auto found = mesh.surfaces.find(name);
  if (found == mesh.surfaces.end()) throw Error("contact: the mesh has no surface '" + name + "'");
  for (const Face& face : found->second)
    if (face.shape == FaceShape::triangle6 || face.shape == FaceShape::quad8)
      throw Error("contact surface '" + name + "' has " + std::to_string(node_count(face.shape)) +
                  "-node faces, whose consistent nodal forces are not all positive: node-to-node contact needs 3-, 4- "
                  "or 9-node faces. Mesh the bodies in contact with linear elements");
  return found->second;
}

std::vector<int> nodes_of(const std::vector<Face>& faces)
{
  std::vector<int> nodes;
  for (const Face& face : faces)
    nodes.insert(nodes.end(), face.nodes.begin(), face.nodes.begin() + node_count(face.shape));
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

double size_of(const std::vector<int>& nodes, const std::vector<Vec3>& x)
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

// Nearest of a set of nodes, found from their order along x.
class Nearest
{
public:
  Nearest(std::vector<int> nodes, const std::vector<Vec3>& x) : nodes_(std::move(nodes)), x_(x)
  {
    std::sort(nodes_.begin(), nodes_.end(), [&](int a, int b) { return x_[a] < x_[b]; });
  }

  std::pair<int, double> to(const Vec3& at) const
  {
    const auto start =
        std::lower_bound(nodes_.begin(), nodes_.end(), at[0], [&](int n, double v) { return x_[n][0] < v; });
    int best = -1;
    double least = std::numeric_limits<double>::infinity();
    const auto consider = [&](int node)
    {
      if (std::abs(x_[node][0] - at[0]) > least) return false;
      const double distance = norm(x_[node] - at);
      if (distance < least) least = distance, best = node;
      return true;
    };
    for (auto it = start; it != nodes_.end() && consider(*it); ++it)
    {
    }
    for (auto it = start; it != nodes_.begin() && consider(*(it - 1)); --it)
    {
    }
    return {best, least};
  }

private:
  std::vector<int> nodes_;
  const std::vector<Vec3>& x_;
};

// Of each of `from`, its partner among `to`; throws when some have none.
std::vector<int> partners(const std::vector<int>& from, const std::vector<int>& to, const std::vector<Vec3>& x,
                          const std::string& from_name, const std::string& to_name)
{
  const double tolerance = 1e-6 * std::max(size_of(from, x), size_of(to, x));
  const Nearest nearest(to, x);
  std::vector<int> found;
  int alone = 0, worst = -1;
  double farthest = 0;
  for (const int node : from)
  {
    const auto [partner, distance] = nearest.to(x[node]);
    found.push_back(partner);
    if (distance <= tolerance) continue;
    ++alone;
    if (distance > farthest) farthest = distance, worst = node;
  }
  if (!alone) return found;
  std::ostringstream text;
  text << "contact surfaces '" << from_name << "' and '" << to_name << "' do not match: " << alone << " of the "
       << from.size() << " nodes of '" << from_name << "' have no partner within " << tolerance
       << " m; the farthest is " << farthest << " m away, from (" << x[worst][0] << ", " << x[worst][1] << ", "
       << x[worst][2] << "). Give both surfaces the same nodes in the same places";
  throw Error(text.str());
}

// Where nodes are compared: with a reach, as they are seen along the normal.
std::vector<Vec3> compared_at(const Mesh& mesh, const Contact& contact)
{
  std::vector<Vec3> x = mesh.nodes;
  if (contact.reach > 0)
    for (Vec3& at : x) at = at - dot(at, *contact.normal) * *contact.normal;
  return x;
}

// By how much the partners stand apart along the normal.
double distance_of(const Mesh& mesh, const Contact& contact, int a, int b)
{
  if (contact.reach == 0) return 0;
  const double distance = dot(mesh.nodes[b] - mesh.nodes[a], *contact.normal);
  if (distance >= -1e-6 * contact.reach && distance <= contact.reach) return std::max(0., distance);
  std::ostringstream text;
  text << "contact surfaces '" << contact.rotor << "' and '" << contact.stator << "': partners at (" << mesh.nodes[a][0]
       << ", " << mesh.nodes[a][1] << ", " << mesh.nodes[a][2] << ") are " << distance << " m apart along the normal, "
       << (distance < 0 ? "the stator inside the rotor: turn the normal or mend the mesh"
                        : "farther than the contact's reach: raise it or make the surfaces smaller");
  throw Error(text.str());
}

void match_surfaces(const Mesh& mesh, const Contact& contact, int index, std::vector<NodePair>& pairs)
{
  const std::vector<Face>& faces = contact_surface(mesh, contact.rotor);
  const std::vector<int> a = nodes_of(faces), b = nodes_of(contact_surface(mesh, contact.stator));
  std::vector<int> shared;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(shared));
  if (!shared.empty())
    throw Error("contact surfaces '" + contact.rotor + "' and '" + contact.stator + "' share " +
                std::to_string(shared.size()) +
                " nodes, so the bodies are joined there: give each body its own copy of the surface and its nodes");
  const std::vector<Vec3> x = compared_at(mesh, contact);
  const std::vector<int> of_a = partners(a, b, x, contact.rotor, contact.stator);
  partners(b, a, x, contact.stator, contact.rotor);

  std::map<int, std::pair<Vec3, double>> weight; // vector area and area of each rotor node
  for (const Face& face : faces)
  {
    const std::vector<Vec3> shares = nodal_weights(face, mesh.nodes);
    for (std::size_t i = 0; i < shares.size(); ++i)
    {
      auto& [vector, area] = weight[face.nodes[i]];
      vector = vector + shares[i];
      area += norm(shares[i]);
    }
  }
  for (std::size_t i = 0; i < a.size(); ++i)
  {
    const auto& [vector, area] = weight.at(a[i]);
    const Vec3 normal = contact.normal ? *contact.normal : vector;
    pairs.push_back(
        {a[i], of_a[i], (1 / norm(normal)) * normal, area, index, distance_of(mesh, contact, a[i], of_a[i])});
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
