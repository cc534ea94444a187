#include "constraints.hpp"

#include "squeal/mesh/shape_functions.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Dense>

namespace squeal
{

namespace
{

Eigen::Vector3d as_eigen(const Vec3& x)
{
  return Eigen::Vector3d(x.data());
}

/// a x as a matrix.
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& a)
{
  Eigen::Matrix3d result;
  result << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return result;
}

/// A row that must vanish or have a value.
struct ConstraintRow
{
  std::vector<ConstraintTerm> terms;
  double value = 0; // [m, rad]
};

/// Solves a row for the free motion of its largest factor. Throws Error for one that the others contradict.
void add_row(Constraints& constraints, const ConstraintRow& row, const std::string& user)
{
  constexpr double rounding = 1e-12, implied = 1e-9;
  FreeSum sum;
  double size = 0;
  for (const auto& [nodal_dof, factor] : row.terms)
  {
    add_expanded(constraints, nodal_dof, factor, sum);
    size = std::max(size, std::abs(factor));
  }
  const auto largest = std::ranges::max_element(sum.factors, {}, [](const auto& f) { return std::abs(f.second); });
  const double missing = row.value - sum.constant;
  if (largest == sum.factors.end() || std::abs(largest->second) <= implied * size)
  {
    if (std::abs(missing) > implied * std::max(std::abs(row.value), std::abs(sum.constant)))
      throw Error(user + format(" should move by %g, but what is held elsewhere moves it by %g: free one of them",
                                row.value, sum.constant));
    return;
  }
  const auto [pivot, own] = *largest;
  std::vector<ConstraintTerm> terms;
  for (const auto& [nodal_dof, factor] : sum.factors)
    if (nodal_dof != pivot && std::abs(factor) > rounding * std::abs(own)) terms.push_back({nodal_dof, -factor / own});
  if (missing != 0) constraints.shift[pivot] = missing / own;
  if (terms.empty())
    constraints.kind[pivot] = DofKind::fixed;
  else
    make_dependent(constraints, pivot, std::move(terms));
}

std::vector<Weighted> weighted_nodes(const Coupling& coupling, const Mesh& mesh)
{
  std::vector<Weighted> result;
  for (std::size_t i = 0; i < coupling.on.size(); ++i)
    for (const int node : named_nodes(mesh, coupling.on[i], "coupling " + coupling.name))
      result.push_back({node, coupling.weights.empty() ? 1 : coupling.weights[i]});
  return result;
}

/// The motions of a node that a support holds in its frame.
void hold_node(Constraints& constraints, const Mesh& mesh, const Support& support, int node)
{
  const std::string user = "support on " + support.on;
  const std::array<Vec3, 3> axes = axes_at(support.frame, mesh.nodes[node], user);
  for (int motion = 0; motion < 6; ++motion)
  {
    const auto i = static_cast<std::size_t>(motion);
    if (!support.fixed[i]) continue;
    const int first = motion < 3 ? 0 : 3;
    const Vec3& axis = axes[i % 3];
    ConstraintRow row{{}, motion < 3 ? support.displacement[i] : support.rotation[i - 3]};
    for (int c = 0; c < 3; ++c)
      if (const double part = axis[static_cast<std::size_t>(c)];
          constraints.kind_of(node, first + c) != DofKind::absent && part != 0)
        row.terms.push_back({6 * PetscInt{node} + first + c, part});
    if (row.terms.empty()) continue;
    add_row(constraints, row, user + ": " + node_text(node, mesh.nodes[node]) + ", " + motion_words[i]);
  }
}

void lock(Constraints& constraints, const Mesh& mesh, const Connector& connector)
{
  const auto [nodes, rows] = relative_motion(connector, mesh);
  for (int motion = 0; motion < 6; ++motion)
  {
    if (!connector.locked[static_cast<std::size_t>(motion)]) continue;
    ConstraintRow row;
    for (Eigen::Index k = 0; k < rows.cols(); ++k)
      if (rows(motion, k) != 0)
        row.terms.push_back(
            {6 * PetscInt{nodes[static_cast<std::size_t>(k / 6)]} + static_cast<PetscInt>(k % 6), rows(motion, k)});
    add_row(constraints, row, label_of(connector) + ": its locked " + motion_words[static_cast<std::size_t>(motion)]);
  }
}

} // namespace

void add_expanded(const Constraints& constraints, PetscInt nodal_dof, double factor, FreeSum& sum)
{
  const DofKind kind = constraints.kind[nodal_dof];
  if (kind == DofKind::free) sum.factors[nodal_dof] += factor;
  if (const auto shift = constraints.shift.find(nodal_dof); shift != constraints.shift.end())
    sum.constant += factor * shift->second;
  if (kind != DofKind::dependent) return;
  for (const ConstraintTerm& term : constraints.dependent.at(nodal_dof))
    if (term.factor != 0) add_expanded(constraints, term.nodal_dof, factor * term.factor, sum);
}

void make_dependent(Constraints& constraints, PetscInt nodal_dof, std::vector<ConstraintTerm> terms)
{
  constraints.kind[nodal_dof] = DofKind::dependent;
  constraints.dependent[nodal_dof] = std::move(terms);
}

std::array<std::vector<ConstraintTerm>, 6> rows_of_cloud(const Mesh& mesh, const std::vector<Weighted>& cloud,
                                                         const Vec3& at, const std::string& user)
{
  constexpr double least_spread = 1e-9; // of the moments of the nodes, about any axis
  double whole = 0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const auto& [node, weight] : cloud)
  {
    whole += weight;
    centre += weight * as_eigen(mesh.nodes[node]);
  }
  centre /= whole;
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const auto& [node, weight] : cloud)
  {
    const Eigen::Matrix3d r = cross_matrix(as_eigen(mesh.nodes[node]) - centre);
    moments -= weight * r * r;
  }
  const Eigen::Vector3d spread = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments).eigenvalues();
  if (!(spread(0) > least_spread * spread(2)))
    throw Error(user + ": its " + std::to_string(cloud.size()) +
                " nodes are on a line or at one place, so they do not turn it about every axis: take nodes beside it");
  const Eigen::Matrix3d inverse = moments.inverse(), arm = cross_matrix(as_eigen(at) - centre);
  std::array<std::vector<ConstraintTerm>, 6> rows;
  for (const auto& [node, weight] : cloud)
  {
    Eigen::Matrix<double, 6, 3> factors;
    factors.bottomRows<3>() = weight * inverse * cross_matrix(as_eigen(mesh.nodes[node]) - centre);
    factors.topRows<3>() = weight / whole * Eigen::Matrix3d::Identity() - arm * factors.bottomRows<3>();
    for (int motion = 0; motion < 6; ++motion)
      for (int c = 0; c < 3; ++c)
        rows[static_cast<std::size_t>(motion)].push_back({6 * PetscInt{node} + c, factors(motion, c)});
  }
  return rows;
}

RelativeMotion relative_motion(const Connector& connector, const Mesh& mesh)
{
  RelativeMotion result;
  for (const std::string& name : {connector.from, connector.to})
    if (name != ground) result.nodes.push_back(point_node(mesh, name, label_of(connector)));
  const auto count = static_cast<Eigen::Index>(result.nodes.size());
  Vec3 at = connector.at.value_or(Vec3{});
  if (!connector.at)
    for (const int node : result.nodes) at = at + 1. / static_cast<double>(count) * mesh.nodes[node];
  result.rows = Eigen::MatrixXd::Zero(6, 6 * count);
  for (Eigen::Index i = 0; i < count; ++i)
  {
    const double sign = i == 1 ? 1 : -1;
    auto block = result.rows.middleCols<6>(6 * i);
    block.diagonal().setConstant(sign);
    block.topRightCorner<3, 3>() =
        -sign * cross_matrix(as_eigen(at - mesh.nodes[result.nodes[static_cast<std::size_t>(i)]]));
  }
  const NodePositions axes = position_matrix(axes_at(connector.frame, at, label_of(connector)));
  for (const int first : {0, 3})
    result.rows.middleRows<3>(first) = (axes.transpose() * result.rows.middleRows<3>(first)).eval();
  return result;
}

std::string label_of(const Connector& connector)
{
  return "connector from " + connector.from + " to " + connector.to;
}

void hold(Constraints& constraints, const Mesh& mesh, const Support& support)
{
  for (const int node : named_nodes(mesh, support.on, "support")) hold_node(constraints, mesh, support, node);
}

void add_couplings(Constraints& constraints, const Mesh& mesh, const std::vector<Coupling>& couplings)
{
  for (const Coupling& coupling : couplings)
  {
    auto rows = rows_of_cloud(mesh, weighted_nodes(coupling, mesh), coupling.at, "coupling " + coupling.name);
    for (std::size_t motion = 0; motion < 6; ++motion)
      make_dependent(constraints, 6 * PetscInt{mesh.points.at(coupling.name)} + static_cast<PetscInt>(motion),
                     std::move(rows[motion]));
  }
}

void add_rows(Constraints& constraints, const Mesh& mesh, const Scene& scene)
{
  for (const Support& support : scene.supports)
    if (!is_plain(support)) hold(constraints, mesh, support);
  for (const Connector& connector : scene.connectors) lock(constraints, mesh, connector);
}

} // namespace squeal
