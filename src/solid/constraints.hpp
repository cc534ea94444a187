#pragma once
/// Linear constraints on the nodal degrees of freedom, before the free ones are numbered.
#include "squeal/solid/dofs.hpp"

#include <Eigen/Core>
#include <unordered_map>

namespace squeal
{

enum class DofKind : char
{
  absent, // the node has no such component
  free,
  fixed,
  dependent, // a linear combination of others
};

struct ConstraintTerm
{
  PetscInt nodal_dof = 0;
  double factor = 0; // [-, m, 1/m]
};

struct Constraints
{
  std::vector<DofKind> kind; // of each nodal degree of freedom
  std::unordered_map<PetscInt, std::vector<ConstraintTerm>> dependent;
  std::unordered_map<PetscInt, double> shift; // [m, rad] that a fixed or dependent one has beside its terms; else none

  DofKind& kind_of(int node, int component) { return kind[6 * PetscInt{node} + component]; }
};

/// Factors of free nodal degrees of freedom, and what is added to them.
struct FreeSum
{
  std::map<PetscInt, double> factors{};
  double constant = 0;
};

/// Adds factor * u(nodal_dof), by the free ones that it depends on. A dependent degree of freedom may depend on
/// another, as a joint's rotation on the solid nodes of a rigid body. It never depends on itself.
void add_expanded(const Constraints& constraints, PetscInt nodal_dof, double factor, FreeSum& sum);

void make_dependent(Constraints& constraints, PetscInt nodal_dof, std::vector<ConstraintTerm> terms);

/// The motion of `to` against `from` that a connector reads in its frame, both taken to its place as rigid bodies.
struct RelativeMotion
{
  std::vector<int> nodes; // one against the ground, or two
  Eigen::MatrixXd rows{}; // 6 x 6 n, of their motions
};

RelativeMotion relative_motion(const Connector& connector, const Mesh& mesh);

/// A connector in messages.
std::string label_of(const Connector& connector);

/// A node of a cloud with its weight.
struct Weighted
{
  int node = 0;
  double weight = 1;
};

/// Rows of the six motions of a place that follows a cloud of nodes:
///     theta = I^-1 sum w_i r_i x u_i,   u = sum w_i u_i/sum w_i + theta x (at - c),
/// with r_i from the weighted centroid c and I = sum w_i (|r_i|^2 1 - r_i r_i'). Throws Error for nodes on a line.
std::array<std::vector<ConstraintTerm>, 6> rows_of_cloud(const Mesh& mesh, const std::vector<Weighted>& cloud,
                                                         const Vec3& at, const std::string& user);

/// The motions of couplings by those of their nodes.
void add_couplings(Constraints& constraints, const Mesh& mesh, const std::vector<Coupling>& couplings);

/// The motions that a support holds or moves. Each is a row, solved for the free motion of its largest factor: of a
/// node of a rigid body it holds the body. One that others imply is left out. Throws Error for one that contradicts
/// them.
void hold(Constraints& constraints, const Mesh& mesh, const Support& support);

/// The motions that supports hold in frames of their own or move, and those that connectors lock, as rows of the same
/// kind.
void add_rows(Constraints& constraints, const Mesh& mesh, const Scene& scene);

} // namespace squeal
