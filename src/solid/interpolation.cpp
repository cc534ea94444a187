/// The row of a free degree of freedom of `to`, component c of a node at x: sum_k N_k(xi) u_kc over the nodes k of the
/// element of `from` that contains x. Constraints of `from` enter by u = T q, those of `to` hold since they are never
/// interpolated.
///
/// Caveat: bending between the nodes of a shell is linear, and what incompatible modes add inside a brick is left out.
#include "squeal/solid/interpolation.hpp"

#include "squeal/mesh/location.hpp"
#include "squeal/mesh/shapes.hpp"

#include <array>
#include <memory>

namespace squeal
{

namespace
{

constexpr double farthest = 1; // half widths outside of the coarse part: chords of a quarter circle leave 0.6
/// Of the way to the element's middle: two sides in contact are distinguished. Where coarse elements are smaller than
/// the node's own, the first way may end in one that is not next to the node.
constexpr std::array inwards = {0.05, 0.01, 0.002};

/// The first element of each node; -1 for a node of its own.
std::vector<int> first_elements(const Mesh& mesh)
{
  std::vector<int> first(mesh.nodes.size(), -1);
  for (std::size_t i = mesh.elements.size(); i-- > 0;)
    for (const int node : nodes_of(mesh.elements[i])) first[static_cast<std::size_t>(node)] = static_cast<int>(i);
  return first;
}

Vec3 middle_of(const Mesh& mesh, const Element& element)
{
  Vec3 sum{};
  const auto nodes = nodes_of(element);
  for (const int node : nodes) sum = sum + mesh.nodes[node];
  return 1. / static_cast<double>(nodes.size()) * sum;
}

/// Nodes of `from` by those of `to`: of points and bodies by name, of modal coordinates by their order.
std::map<int, int> same_nodes(const Mesh& from, const Mesh& to)
{
  std::map<int, int> same;
  for (const auto& [name, node] : to.points) same[node] = from.points.at(name);
  for (std::size_t s = 0; s < to.superelements.size(); ++s)
    for (std::size_t i = 0; i < to.superelements[s].size(); ++i)
      if (const SuperelementRow& row = to.superelements[s][i]; row.coordinate)
        same[row.node] = from.superelements.at(s).at(i).node;
  return same;
}

/// Reads displacements of `from` at the nodes of `to`.
class NodeReader
{
public:
  NodeReader(const Mesh& from, const Mesh& to, const Scene& scene)
      : from_(from), to_(to), scene_(scene), first_(first_elements(to)), same_(same_nodes(from, to)),
        locators_(scene.parts.size())
  {
  }

  std::vector<std::pair<int, double>> of(int node)
  {
    if (const auto found = same_.find(node); found != same_.end()) return {{found->second, 1.}};
    const Element& element = to_.elements[static_cast<std::size_t>(first_[static_cast<std::size_t>(node)])];
    const Vec3& at = to_.nodes[node];
    auto& locator = locators_[static_cast<std::size_t>(element.part)];
    if (!locator) locator = std::make_unique<ElementLocator>(from_, element.part);
    const Location found = nearest(*locator, at, middle_of(to_, element) - at);
    if (!(found.excess <= farthest))
      throw Error(node_text(node, at) + " lies outside of part '" +
                  scene_.parts[static_cast<std::size_t>(element.part)].name +
                  "' of the coarse mesh: both meshes must be of the same geometry, in the same unit");
    const Element& coarse = from_.elements[static_cast<std::size_t>(found.element)];
    const ShapeFunctions N = shape_functions(coarse.shape, found.xi);
    std::vector<std::pair<int, double>> weights;
    for (const int k : nodes_of(coarse)) weights.emplace_back(k, N.N(static_cast<Eigen::Index>(weights.size())));
    return weights;
  }

private:
  /// Of the coarse elements on the way inwards the one that the node leaves least.
  Location nearest(const ElementLocator& locator, const Vec3& at, const Vec3& to_middle) const
  {
    constexpr double none = 1e-9; // rounding of the excess
    Location best;
    for (std::size_t i = 0; i < inwards.size() && !(best.excess <= none); ++i)
    {
      const Location inside = locator.find(at + inwards[i] * to_middle);
      if (inside.element < 0) continue;
      const Location found = located(from_, inside.element, at);
      if (found.excess < best.excess) best = found;
    }
    return best;
  }

  const Mesh& from_;
  const Mesh& to_;
  const Scene& scene_;
  std::vector<int> first_;
  std::map<int, int> same_;
  std::vector<std::unique_ptr<ElementLocator>> locators_; // of each part, made when it is asked for
};

} // namespace

Interpolation::Interpolation(const NumberedMesh& from, const NumberedMesh& to, const Scene& scene, MPI_Comm comm)
    : from_(from), to_(to)
{
  on_rank_zero(comm,
               [&]
               {
                 NodeReader reader(from.mesh, to.mesh, scene);
                 int last = -1; // the node whose shares were added last
                 std::size_t begin = 0;
                 for (const PetscInt nodal_dof : to.dofs.names.nodal_dof)
                 {
                   const auto node = static_cast<int>(nodal_dof / 6);
                   if (node != last)
                   {
                     begin = shares_.size();
                     for (const auto& [k, weight] : reader.of(node)) shares_.push_back({k, weight});
                   }
                   last = node;
                   offsets_.push_back(begin);
                   ends_.push_back(shares_.size());
                 }
               });
}

void Interpolation::apply(Vec coarse, Vec fine) const
{
  const std::vector<double> q = all_entries(coarse);
  for (std::size_t i = 0; i < offsets_.size(); ++i)
  {
    const PetscInt motion = to_.dofs.names.nodal_dof[i] % 6;
    double entry = 0;
    for (std::size_t k = offsets_[i]; k < ends_[i]; ++k)
      for (const DofTerm& term : from_.dofs.terms_of(6 * PetscInt{shares_[k].node} + motion))
        entry += shares_[k].weight * term.factor * q[static_cast<std::size_t>(term.dof)];
    check(VecSetValue(fine, static_cast<PetscInt>(i), entry, INSERT_VALUES));
  }
  check(VecAssemblyBegin(fine));
  check(VecAssemblyEnd(fine));
}

} // namespace squeal
