#include "squeal/solid/dofs.hpp"

#include "local_dofs.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/mesh/shapes.hpp"

#include <algorithm>
#include <numeric>

namespace squeal
{

namespace
{

/// The first degree of freedom of each rank, and the end.
std::vector<PetscInt> rank_starts(const MeshPiece& whole, int ranks)
{
  std::vector<PetscInt> starts(static_cast<std::size_t>(ranks) + 1, 0);
  for (const PetscInt nodal_dof : whole.dofs.names.nodal_dof)
    ++starts[static_cast<std::size_t>(whole.partition.node_rank[static_cast<std::size_t>(nodal_dof / 6)]) + 1];
  std::partial_sum(starts.begin(), starts.end(), starts.begin());
  return starts;
}

/// The elements that each rank but the first needs, ascending.
std::vector<std::vector<int>> elements_by_rank(const MeshPiece& whole, const std::vector<PetscInt>& starts)
{
  std::vector<std::vector<int>> result(starts.size() - 1);
  const auto give = [&](std::size_t rank, int element)
  {
    if (rank > 0 && (result[rank].empty() || result[rank].back() != element)) result[rank].push_back(element);
  };
  for (std::size_t e = 0; e < whole.mesh.elements.size(); ++e)
  {
    const int element = static_cast<int>(e);
    give(static_cast<std::size_t>(whole.partition.element_rank[e]), element);
    for (const PetscInt nodal_dof : nodal_dofs_of(whole.mesh.elements[e]))
      for (const DofTerm& term : whole.dofs.terms_of(nodal_dof))
        give(static_cast<std::size_t>(std::ranges::upper_bound(starts, term.dof) - starts.begin() - 1), element);
  }
  return result;
}

/// `place` has -1 for every node of the whole mesh, before and after.
MeshPiece piece_of(const MeshPiece& whole, const std::vector<int>& elements, std::vector<int>& place)
{
  MeshPiece piece;
  std::vector<int>& nodes = piece.node_numbers;
  for (const int e : elements)
    for (const int node : nodes_of(whole.mesh.elements[static_cast<std::size_t>(e)]))
      if (place[static_cast<std::size_t>(node)] < 0)
      {
        place[static_cast<std::size_t>(node)] = 0;
        nodes.push_back(node);
      }
  std::ranges::sort(nodes);
  piece.dofs.offsets.push_back(0);
  for (std::size_t i = 0; i < nodes.size(); ++i)
  {
    place[static_cast<std::size_t>(nodes[i])] = static_cast<int>(i);
    piece.mesh.nodes.push_back(whole.mesh.nodes[static_cast<std::size_t>(nodes[i])]);
    for (int c = 0; c < 6; ++c)
    {
      const auto terms = whole.dofs.terms_of(6 * PetscInt{nodes[i]} + c);
      piece.dofs.terms.insert(piece.dofs.terms.end(), terms.begin(), terms.end());
      piece.dofs.offsets.push_back(piece.dofs.terms.size());
    }
  }
  piece.element_numbers = elements;
  for (const int e : elements)
  {
    Element element = whole.mesh.elements[static_cast<std::size_t>(e)];
    for (int i = 0; i < node_count(element.shape); ++i) element.nodes[i] = place[element.nodes[i]];
    piece.mesh.elements.push_back(element);
    piece.partition.element_rank.push_back(whole.partition.element_rank[static_cast<std::size_t>(e)]);
  }
  for (const int node : nodes) place[static_cast<std::size_t>(node)] = -1;
  return piece;
}

/// Calls pass(list) for every list of a piece that is sent.
template <class Piece, class Pass> void for_each_list(Piece& piece, Pass pass)
{
  pass(piece.mesh.nodes);
  pass(piece.mesh.elements);
  pass(piece.partition.element_rank);
  pass(piece.node_numbers);
  pass(piece.element_numbers);
  pass(piece.dofs.offsets);
  pass(piece.dofs.terms);
}

} // namespace

void distribute(MeshPiece& piece, MPI_Comm comm)
{
  const int ranks = ranks_of(comm), rank = rank_of(comm);
  if (ranks == 1) return;
  std::vector<PetscInt> starts;
  std::vector<MeshPiece> pieces; // of the other ranks; all before any is sent, so that a failure reaches every rank
  on_rank_zero(comm,
               [&]
               {
                 starts = rank_starts(piece, ranks);
                 const std::vector<std::vector<int>> elements = elements_by_rank(piece, starts);
                 std::vector<int> place(piece.mesh.nodes.size(), -1);
                 for (std::size_t r = 1; r < elements.size(); ++r)
                   pieces.push_back(piece_of(piece, elements[r], place));
               });
  for (int to = 1; rank == 0 && to < ranks; ++to)
    for_each_list(pieces[static_cast<std::size_t>(to) - 1], [&](const auto& list) { send(list, to, comm); });
  if (rank != 0)
  {
    piece = {};
    for_each_list(piece, [&](auto& list) { receive(list, 0, comm); });
  }
  broadcast(starts, comm);
  broadcast(piece.dofs.names.nodal_dof, comm);
  piece.dofs.first = starts[static_cast<std::size_t>(rank)];
  piece.dofs.last = starts[static_cast<std::size_t>(rank) + 1];
  piece.dofs.size = starts.back();
}

} // namespace squeal
