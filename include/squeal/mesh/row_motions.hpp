#pragma once
/// Text files of lines: what the rows of another code's matrices are, and gaps of nodes. Not collective: the caller
/// reads on rank 0.
#include "squeal/base/vec3.hpp"

#include <filesystem>
#include <vector>

namespace squeal
{

/// A motion of a node of another code's model.
struct NodeMotion
{
  long node = -1;  // its number there
  int motion = -1; // of motion_words; -1: not the motion of a node, such as a modal coordinate
};

/// Returns the motions in a `dofs.txt`, which has a line "node motion" for each row, such as "1017 rx", or "-" for the
/// motion. Throws Error with the line that is wrong.
std::vector<NodeMotion> read_row_motions(const std::filesystem::path& file);

/// A node of another code's model and its place.
struct PlacedNode
{
  long node = -1; // its number
  Vec3 at{};      // [m]
};

/// The gap of the node at a place.
struct PlacedGap
{
  Vec3 at{};      // [m]
  double gap = 0; // [m]
};

/// Returns the gaps in a file, which has a line "x y z gap" for each. Throws Error with the line that is wrong.
std::vector<PlacedGap> read_gaps(const std::filesystem::path& file);

/// Returns the nodes in a `nodes.txt`, which has a line "node x y z" for each. Throws Error with the line that is
/// wrong.
std::vector<PlacedNode> read_placed_nodes(const std::filesystem::path& file);

} // namespace squeal
