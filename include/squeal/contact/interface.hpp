#pragma once
/// The contact interface: pairs, the gap and sliding operators, and the drive (src/README.md, section 1).
///     g = gap + B_n u >= 0,   s = B_t v - v_d,   r_n >= 0 pushes the pair apart,   |r_t| <= mu r_n.
///
/// Contact vectors (reactions, gaps, velocities) live whole on every rank as std::vector<double>, `block` entries a
/// pair: normal first, then one or two tangential ones. They are small; the structure is not.
#include "squeal/solid/structure.hpp"

namespace squeal
{

enum class ContactStatus : char
{
  open,
  stick,
  slip,
};

struct Interface
{
  int pairs = 0;
  int directions = 2;         // tangential rows a pair: 1 or 2
  Owned<Mat> B;               // (pairs * block) x dofs, AIJ; row i * block + k
  std::vector<double> gap;    // [m] per pair
  std::vector<double> drive;  // [m/s] pairs * directions: v_d
  std::vector<int> contact;   // per pair, index in Scene::contacts; empty on a matrix scene
  std::vector<Vec3> position; // [m] per pair; empty on a matrix scene
  double friction = 0;        // mu
  bool direction_damping = true;

  int block() const { return 1 + directions; }
  std::size_t size() const { return static_cast<std::size_t>(pairs) * static_cast<std::size_t>(block()); }
};

/// Rows n, t1, t2 of every pair: n.(u_b - u_a), t.(u_b - u_a). Tangents: the scene's, else t1 along the drive.
/// Error: zero drive velocity at a pair where mu > 0.
Interface make_interface(const Mesh& mesh, const std::vector<NodePair>& pairs, const Scene& scene, const DofMap& dofs,
                         MPI_Comm comm);

/// B.petsc gap.petsc drive.petsc of a folder; directions = (rows of B) / pairs - 1.
Interface read_interface(const std::filesystem::path& folder, const Structure& structure, const FrictionLaw& friction,
                         MPI_Comm comm);

/// B x, whole on every rank. Collective.
std::vector<double> relative(const Interface& interface, Vec x);

/// y += B^T r. Collective; r the same on every rank.
void add_reactions(const Interface& interface, const std::vector<double>& r, Vec y);

/// Unit drive direction e = v_d/|v_d| of every pair (pairs * directions): reactions of steady sliding are r_t = mu r_n
/// e.
std::vector<double> drive_directions(const Interface& interface);

} // namespace squeal
