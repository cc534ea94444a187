#pragma once
/// Integrals over the part of a slave face that master faces cover (src/README.md, section 1.9).
#include "squeal/mesh/contact_pairs.hpp"
#include "squeal/mesh/shape_functions.hpp"

#include <algorithm>

namespace squeal
{

using FaceValues = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 9, 1>;
using FaceMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 9, 9>;

/// Factors T of the multipliers' functions chi = T phi: the Bernstein polynomials of the face's order at its nodes. So
/// chi = phi on linear faces. On quadratic ones a corner takes a quarter of its mid-sides, and a mid-side keeps half.
/// They are not negative on triangles, and their integrals are positive.
const FaceMatrix& multiplier_factors(Shape shape);

/// A face with its nodes and what stands of it beside the plane through its corners.
struct PlacedFace
{
  Shape shape{};
  NodePositions x;                                  // [m]
  Eigen::Vector3d normal = Eigen::Vector3d::Zero(); // [-] outward, mean over the face
  double slack = 0;       // [m] how far the face may stand off the curved surface for which it stands
  bool two_sided = false; // a shell's
};

/// The part of one slave face that master faces cover. Functions chi are the slave's, N the master's.
struct CoveredFace
{
  struct Master
  {
    int face = 0;        // index among the candidates' faces
    FaceMatrix coupling; // [m2] int chi_i N_j
  };
  FaceValues whole, area; // [m2] int chi_i over the whole face and over the covered part
  FaceMatrix gram;        // [m2] int chi_i chi_j over the covered part
  std::vector<Master> masters;
};

/// Overlaps that were left out, or contain each other. Places are on the slave face.
struct OverlapFindings
{
  double nearest = 0; // [m] gap of the nearest one beyond the limit, negative inside; 0: none
  Vec3 nearest_at{};
  double deepest = 0; // [m] largest depth of one surface in the other; 0: none
  Vec3 deepest_at{};
  bool same_way = false; // faces within the limit whose normals do not oppose each other
  Vec3 same_way_at{};
};

/// How slave and master faces are compared.
struct OverlapLimits
{
  double distance = 0;   // [m] largest gap
  double rounding = 0;   // [m] depth, or with `closes` gap, that is no more than rounding
  bool closes = false;   // surfaces that should coincide: the faces' slacks limit the gap, not the distance
  Eigen::Vector3d along; // [-] out of the slave; zero: along the normal of the slave face
  double search = 0;     // [m] faces farther than the limits are looked at too up to here, for the findings
};

/// Returns the integrals over the overlaps with these candidates, an index in `masters` each.
CoveredFace cover_face(const PlacedFace& slave, std::span<const PlacedFace> masters, std::span<const int> candidates,
                       const OverlapLimits& limits, OverlapFindings& findings);

// Rows of the gap operator by dual multipliers on the covered part of the slave surface (src/README.md, section 1.9).

/// A named surface in contact.
struct ContactSurface
{
  const std::string& name;
  const std::vector<Face>& faces;
  std::vector<int> nodes;         // ascending
  std::vector<PlacedFace> placed; // one a face
  std::vector<int> patch;         // of each face; faces that share an edge are of one
  std::vector<Vec3> normals;      // [-] of each node, outward, unit
  double size = 0;                // [m] diagonal of the bounding box

  /// Place of a node in `nodes`.
  std::size_t place_of(int node) const;
};

/// `user` says in messages what asks for it. Throws Error for a missing surface.
ContactSurface contact_surface(const Mesh& mesh, const std::string& name, const std::string& user);

/// A row of the gap operator: weights are multiplied by the area.
struct SlaveRow
{
  double area = 0, whole = 0;          // [m2] D of the pair, and its value were the slave surface covered
  std::vector<PairNode> slave, master; // each node once; both lists add up to the area

  /// Whether a face of the node is covered. The area of such a row may be negative where an 8-node face is covered in
  /// part.
  bool is_covered() const { return !master.empty(); }
};

struct SlaveRows
{
  std::vector<SlaveRow> rows; // one a node of the slave surface
  std::vector<char> covered;  // of each slave face: whether it has an overlap
  Coverage coverage;
  OverlapFindings findings; // where nothing is covered, of all that is within the surfaces' size

  /// Whether any slave face is covered.
  bool meet() const { return std::ranges::find(covered, 1) != covered.end(); }
};

/// "share 4 nodes, so that the bodies are joined there"; empty where they share none.
std::string share_text(const ContactSurface& a, const ContactSurface& b);

/// Turns each patch of a shell, which may look to either side, to oppose the other surface. Returns false for a
/// solid's.
bool turn_shell(ContactSurface& turned, const ContactSurface& other);

/// Returns the rows of all slave nodes, light ones included.
/// Throws Error where master faces cover each other.
SlaveRows dual_rows(const ContactSurface& slave, const ContactSurface& master, const OverlapLimits& limits);

/// Fate of a slave node's row.
enum class RowFate
{
  kept,     // and may take others
  kept_own, // but takes no other
  given_up,
};

/// Gives the rows that are given up to the nearest nodes that share a covered face and may take others.
/// Returns the nodes without such a neighbour, as places in slave.nodes.
std::vector<std::size_t> hand_over(const ContactSurface& slave, const std::vector<Vec3>& x,
                                   const std::vector<RowFate>& fate, SlaveRows& rows);

} // namespace squeal
