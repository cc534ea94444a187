#include "contributions.hpp"

#include "constraints.hpp"
#include "kernels.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/solid/binary.hpp"

#include <algorithm>
#include <Eigen/Dense>

namespace squeal
{

namespace
{

/// Adds the mass of a reference point; `inertia` is xx yy zz xy yz zx [kg m2].
void add_mass(const Mesh& mesh, const std::string& name, double mass, const std::array<double, 6>& inertia,
              std::vector<Contribution>& result)
{
  const auto& [xx, yy, zz, xy, yz, zx] = inertia;
  const int node = point_node(mesh, name, "mass");
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(6, 6);
  M.diagonal().head<3>().setConstant(mass);
  M.bottomRightCorner<3, 3>() << xx, xy, zx, xy, yy, yz, zx, yz, zz;
  result.push_back({nodal_dofs_of(std::span(&node, 1), 6), M, 0 * M, 0 * M});
}

/// The elongation d . (u_to - u_from) of a spring gives K = k s s', with s the elongations of unit displacements. The
/// ground does not move; a group has a spring at each of its nodes, of an equal share.
void add_spring(const Mesh& mesh, const Spring& spring, std::vector<Contribution>& result)
{
  const std::string user = "spring from " + spring.from + " to " + spring.to;
  const auto nodes_at = [&](const std::string& name)
  { return name == ground ? std::vector<int>{-1} : named_nodes(mesh, name, user); };
  const std::vector<int> from = nodes_at(spring.from), to = nodes_at(spring.to);
  if (std::min(from.size(), to.size()) > 1)
    throw Error(user + ": both ends are groups, whose nodes have no order: let a [[coupling]] follow one of them, and "
                       "name that");
  const std::size_t count = std::max(from.size(), to.size());
  const Eigen::Vector3d direction(spring.direction.data());
  for (std::size_t i = 0; i < count; ++i)
  {
    std::vector<int> nodes;
    Eigen::VectorXd s;
    for (const auto& [node, sign] :
         {std::pair{from[std::min(i, from.size() - 1)], -1.}, std::pair{to[std::min(i, to.size() - 1)], 1.}})
    {
      if (node < 0) continue;
      nodes.push_back(node);
      s.conservativeResize(s.size() + 3);
      s.tail<3>() = sign * direction;
    }
    const Eigen::MatrixXd square = 1. / static_cast<double>(count) * s * s.transpose();
    result.push_back({nodal_dofs_of(nodes, 3), 0 * square, spring.damping * square, spring.stiffness * square});
  }
}

void add_shared_mass(const Mesh& mesh, const AddedMass& added, std::vector<Contribution>& result)
{
  const std::vector<int> nodes = named_nodes(mesh, added.on, "mass");
  const Eigen::Matrix3d share = added.mass / static_cast<double>(nodes.size()) * Eigen::Matrix3d::Identity();
  for (const int node : nodes) result.push_back({nodal_dofs_of(std::span(&node, 1), 3), share, 0 * share, 0 * share});
}

/// Six numbers are a diagonal, 36 a matrix.
Eigen::MatrixXd six_by_six(const std::vector<double>& values)
{
  if (values.size() == 36) return Eigen::MatrixXd::Map(values.data(), 6, 6);
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(6, 6);
  if (values.size() == 6) result.diagonal() = Eigen::VectorXd::Map(values.data(), 6);
  return result;
}

/// The contribution of matrices with Rayleigh damping, and the viscous equivalent of a loss factor at omega.
Contribution damped(std::vector<PetscInt> nodal_dofs, ElementMatrices matrices, const RayleighDamping& damping,
                    double loss_factor, double omega)
{
  Eigen::MatrixXd C = damping.alpha * matrices.mass + damping.beta * matrices.stiffness;
  if (loss_factor > 0) C += loss_factor / omega * matrices.stiffness;
  return {std::move(nodal_dofs), std::move(matrices.mass), std::move(C), std::move(matrices.stiffness), loss_factor};
}

/// G' R S R' G, with G the relative motion of both ends taken to one place: a rigid motion of both does no work.
Contribution connector_contribution(const Mesh& mesh, const Connector& connector, double omega)
{
  const auto [nodes, strain] = relative_motion(connector, mesh);
  const Eigen::MatrixXd K = strain.transpose() * six_by_six(connector.stiffness) * strain;
  Eigen::MatrixXd C = strain.transpose() * six_by_six(connector.damping) * strain;
  if (connector.loss_factor > 0) C += connector.loss_factor / omega * K;
  return {nodal_dofs_of(nodes, 6), 0 * K, C, K, connector.loss_factor};
}

/// Returns a small matrix in a file, whole. Throws Error unless it is symmetric and of this order.
Eigen::MatrixXd small_matrix(const std::filesystem::path& file, Eigen::Index order)
{
  const MatrixSize size = check_matrix_file(file, PETSC_COMM_SELF);
  if (size.rows != order || size.columns != order)
    throw Error(file.string() + ": " + std::to_string(size.rows) + " x " + std::to_string(size.columns) +
                ", but dofs.txt beside it has " + std::to_string(order) + " lines");
  const Eigen::MatrixXd A = dense_copy(load_matrix(file, size, size, PETSC_COMM_SELF));
  constexpr double rounding = 1e-9; // of exported matrices
  if ((A - A.transpose()).cwiseAbs().maxCoeff() > rounding * A.cwiseAbs().maxCoeff())
    throw Error(file.string() + ": not symmetric");
  return A;
}

Contribution superelement_contribution(const std::vector<SuperelementRow>& rows, const std::filesystem::path& folder,
                                       const RayleighDamping& damping)
{
  for (const char* other : {"F.petsc", "G.petsc", "H.petsc"})
    if (is_file(folder / other))
      throw Error((folder / other).string() + ": a superelement has M, K and C alone: remove the file, and put forces "
                                              "into [[force]] by node");
  Contribution added;
  for (const SuperelementRow& row : rows) added.nodal_dofs.push_back(6 * PetscInt{row.node} + row.motion);
  const auto order = static_cast<Eigen::Index>(added.nodal_dofs.size());
  added.M = small_matrix(folder / "M.petsc", order);
  added.K = small_matrix(folder / "K.petsc", order);
  if (is_file(folder / "C.petsc"))
    added.C = small_matrix(folder / "C.petsc", order);
  else
    added.C = damping.alpha * added.M + damping.beta * added.K;
  return added;
}

/// The material of a part at an element with nodes at x: the axes of an orthotropic one may turn.
Material material_at(const Part& part, const std::vector<Vec3>& x)
{
  Material material = part.material;
  if (!material.orthotropy || !material.orthotropy->cylinder) return material;
  Orthotropy& o = *material.orthotropy;
  Vec3 middle{};
  for (const Vec3& node : x) middle = middle + 1. / static_cast<double>(x.size()) * node;
  const std::array<Vec3, 3> axes = axes_at({o.axis_1, o.axis_2, o.cylinder}, middle, "part " + part.name);
  o.axis_1 = axes[0];
  o.axis_2 = axes[1];
  return material;
}

} // namespace

double loss_omega(const Scene& scene)
{
  return two_pi * scene.damping.loss_frequency;
}

Contribution element_contribution(const NumberedMesh& numbered, const Scene& scene, std::size_t index)
{
  const Element& element = numbered.mesh.elements[index];
  const Part& part = scene.parts[element.part];
  const std::vector<Vec3> x = positions_of(numbered.mesh, nodes_of(element));
  try
  {
    return damped(nodal_dofs_of(element),
                  element_matrices(element.shape, x, material_at(part, x), part.thickness,
                                   arms_of(numbered.mesh, index, part.offset)),
                  part.damping.value_or(scene.damping), part.loss_factor, loss_omega(scene));
  }
  catch (const std::runtime_error& error)
  {
    throw Error("part " + part.name + ", element " + std::to_string(index) + " with " +
                node_text(element.nodes[0], x[0]) + ": " + error.what());
  }
}

std::vector<Contribution> beam_contributions(const Mesh& mesh, const Scene& scene, std::size_t index)
{
  std::vector<Contribution> result;
  const Beam& beam = scene.beams[index];
  const BeamSection section = section_of(beam);
  for (std::size_t i = 1; i < mesh.beams[index].size(); ++i)
  {
    const std::array nodes = {mesh.beams[index][i - 1], mesh.beams[index][i]};
    result.push_back(damped(nodal_dofs_of(nodes, 6),
                            beam_matrices(mesh.nodes[nodes[0]], mesh.nodes[nodes[1]], beam.axis_2, section),
                            scene.damping, beam.loss_factor, loss_omega(scene)));
  }
  return result;
}

std::vector<Contribution> lumped_contributions(const Mesh& mesh, const Scene& scene)
{
  std::vector<Contribution> result;
  for (const Point& point : scene.points) add_mass(mesh, point.name, point.mass, {}, result);
  for (const RigidBody& body : scene.rigid_bodies) add_mass(mesh, body.name, body.mass, body.inertia, result);
  for (const Coupling& coupling : scene.couplings)
    if (coupling.mass > 0 || coupling.inertia != std::array<double, 6>{}) // else it would join all nodes in vain
      add_mass(mesh, coupling.name, coupling.mass, coupling.inertia, result);
  for (const AddedMass& added : scene.masses) add_shared_mass(mesh, added, result);
  for (const Spring& spring : scene.springs) add_spring(mesh, spring, result);
  for (const Connector& connector : scene.connectors)
    if (!connector.stiffness.empty() || !connector.damping.empty())
      result.push_back(connector_contribution(mesh, connector, loss_omega(scene)));
  for (std::size_t i = 0; i < mesh.superelements.size(); ++i)
    result.push_back(superelement_contribution(mesh.superelements[i], scene.superelements[i].folder, scene.damping));
  for (std::size_t i = 0; i < mesh.beams.size(); ++i)
    for (Contribution& of : beam_contributions(mesh, scene, i)) result.push_back(std::move(of));
  return result;
}

std::vector<PetscInt> nodal_dofs_of(std::span<const int> nodes, int components)
{
  std::vector<PetscInt> result;
  for (const int node : nodes)
    for (int c = 0; c < components; ++c) result.push_back(6 * PetscInt{node} + c);
  return result;
}

std::vector<std::size_t> elements_here(const NumberedMesh& numbered)
{
  const DofMap& dofs = numbered.dofs;
  const auto is_here = [&](const DofTerm& term) { return term.dof >= dofs.first && term.dof < dofs.last; };
  std::vector<std::size_t> here;
  for (std::size_t i = 0; i < numbered.mesh.elements.size(); ++i)
    if (std::ranges::any_of(nodal_dofs_of(numbered.mesh.elements[i]),
                            [&](PetscInt own) { return std::ranges::any_of(dofs.terms_of(own), is_here); }))
      here.push_back(i);
  return here;
}

void for_each_contribution(const NumberedMesh& numbered, const Scene& scene, MPI_Comm comm,
                           const std::function<void(const Contribution&, AddedRows)>& visit)
{
  const auto visit_own = [&]
  {
    for (const std::size_t i : elements_here(numbered)) visit(element_contribution(numbered, scene, i), AddedRows::own);
    if (rank_of(comm) != 0) return;
    for (const Contribution& lumped : lumped_contributions(numbered.mesh, scene)) visit(lumped, AddedRows::all);
  };
  on_every_rank(comm, visit_own);
}

std::vector<PetscInt> nodal_dofs_of(const Element& element)
{
  return nodal_dofs_of(nodes_of(element), dofs_per_node(element.shape));
}

LocalDofs local_dofs(const DofMap& dofs, const std::vector<PetscInt>& nodal_dofs, AddedRows added)
{
  LocalDofs local;
  for (const PetscInt nodal_dof : nodal_dofs)
    for (const DofTerm& term : dofs.terms_of(nodal_dof)) local.free.push_back(term.dof);
  std::sort(local.free.begin(), local.free.end());
  local.free.erase(std::unique(local.free.begin(), local.free.end()), local.free.end());
  for (const PetscInt dof : local.free)
    local.rows.push_back(added == AddedRows::all || (dof >= dofs.first && dof < dofs.last) ? dof : -1);
  for (std::size_t i = 0; i < nodal_dofs.size(); ++i)
    for (const DofTerm& term : dofs.terms_of(nodal_dofs[i]))
    {
      const auto place = std::lower_bound(local.free.begin(), local.free.end(), term.dof) - local.free.begin();
      local.terms.push_back({static_cast<Eigen::Index>(i), place, term.factor});
    }
  return local;
}

void add_matrix(Mat matrix, const LocalDofs& local, const Eigen::MatrixXd& A)
{
  const auto count = static_cast<PetscInt>(local.free.size());
  Eigen::MatrixXd AT = Eigen::MatrixXd::Zero(A.rows(), count);
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> sum(count, count);
  sum.setZero();
  for (const LocalTerm& t : local.terms) AT.col(t.free) += t.factor * A.col(t.nodal);
  for (const LocalTerm& t : local.terms) sum.row(t.free) += t.factor * AT.row(t.nodal);
  check(MatSetValues(matrix, count, local.rows.data(), count, local.free.data(), sum.data(), ADD_VALUES));
}

void add_vector(Vec vector, const LocalDofs& local, const Eigen::VectorXd& f)
{
  for (const LocalTerm& t : local.terms)
    if (const PetscInt row = local.rows[static_cast<std::size_t>(t.free)]; row >= 0)
      check(VecSetValue(vector, row, t.factor * f(t.nodal), ADD_VALUES));
}

} // namespace squeal
