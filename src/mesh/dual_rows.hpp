#pragma once
/// Rows of the gap operator by dual multipliers on the covered part of the slave surface (src/README.md, section 1.9).
#include "face_overlap.hpp"
#include "squeal/mesh/contact_pairs.hpp"

#include <algorithm>

namespace squeal
{

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
