/// M, C, K and the load on the free degrees of freedom: sums of T_e^T A_e T_e over blocks, u_e = T_e q.
///
/// A block is an element, or something lumped: a point's or a rigid body's mass, a spring. Every rank knows the whole
/// mesh, so each counts the pattern of its own rows exactly without a word to the others; values of elements that
/// straddle ranks travel at the end. All three matrices receive every block, zeros too: that is their one pattern.
#include "loads.hpp"
#include "matrices.hpp"
#include "squeal/mesh/names.hpp"
#include "squeal/mesh/shapes.hpp"
#include "squeal/mesh/vector.hpp"
#include "squeal/solid/element.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

/// Dense row-major matrices on the motions of a few nodes.
struct Block
{
  std::vector<int> motions; // 6 * node + component
  std::vector<double> M, C, K;
};

std::vector<int> motions_of(const Element& element)
{
  std::vector<int> motions;
  for (int k = 0; k < node_count(element.shape); ++k)
    for (int c = 0; c < dofs_per_node(element.shape); ++c)
      motions.push_back(6 * element.nodes[static_cast<std::size_t>(k)] + c);
  return motions;
}

Block block_on(std::vector<int> motions)
{
  Block block;
  const std::size_t size = motions.size() * motions.size();
  block.motions = std::move(motions);
  block.M.assign(size, 0);
  block.C.assign(size, 0);
  block.K.assign(size, 0);
  return block;
}

std::vector<int> all_motions(int node)
{
  std::vector<int> motions(6);
  for (int c = 0; c < 6; ++c) motions[static_cast<std::size_t>(c)] = 6 * node + c;
  return motions;
}

Block body_block(int node, double mass, const std::array<double, 6>& inertia)
{
  Block block = block_on(all_motions(node));
  static constexpr std::size_t tensor[3][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}}; // of xx yy zz xy yz zx
  for (std::size_t i = 0; i < 3; ++i)
  {
    block.M[7 * i] = mass;
    for (std::size_t j = 0; j < 3; ++j) block.M[6 * (3 + i) + 3 + j] = inertia[tensor[i][j]];
  }
  return block;
}

/// Stretch d . (u_to - u_from) between the reference points; the ground has no motions.
Block spring_block(const Mesh& mesh, const Spring& spring)
{
  std::vector<int> motions;
  std::vector<double> stretch;
  for (const auto& [name, sign] : {std::pair{spring.from, -1.}, std::pair{spring.to, 1.}})
  {
    if (name == "ground") continue;
    const int node = point_node(mesh, name, "spring from " + spring.from + " to " + spring.to);
    for (int c = 0; c < 3; ++c)
    {
      motions.push_back(6 * node + c);
      stretch.push_back(sign * spring.direction[static_cast<std::size_t>(c)]);
    }
  }
  Block block = block_on(std::move(motions));
  for (std::size_t i = 0; i < stretch.size(); ++i)
    for (std::size_t j = 0; j < stretch.size(); ++j)
    {
      block.K[i * stretch.size() + j] = spring.stiffness * stretch[i] * stretch[j];
      block.C[i * stretch.size() + j] = spring.damping * stretch[i] * stretch[j];
    }
  return block;
}

std::vector<Block> lumped_blocks(const Mesh& mesh, const Scene& scene)
{
  std::vector<Block> blocks;
  for (const Point& point : scene.points)
    blocks.push_back(body_block(point_node(mesh, point.name, "point"), point.mass, {}));
  for (const RigidBody& body : scene.rigid_bodies)
    blocks.push_back(body_block(point_node(mesh, body.name, "rigid body"), body.mass, body.inertia));
  for (const Spring& spring : scene.springs) blocks.push_back(spring_block(mesh, spring));
  return blocks;
}

/// Free degrees of freedom that these motions follow, ascending.
std::vector<PetscInt> free_dofs(const DofMap& dofs, const std::vector<int>& motions)
{
  std::vector<PetscInt> result;
  for (const int motion : motions)
    for (const DofTerm& term : dofs.of(motion / 6, motion % 6)) result.push_back(term.dof);
  std::sort(result.begin(), result.end());
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

struct LocalTerm
{
  std::size_t motion = 0, dof = 0; // positions in the block's motions and free dofs
  double factor = 0;
};

std::vector<LocalTerm> local_terms(const DofMap& dofs, const std::vector<int>& motions,
                                   const std::vector<PetscInt>& free)
{
  std::vector<LocalTerm> terms;
  for (std::size_t i = 0; i < motions.size(); ++i)
    for (const DofTerm& term : dofs.of(motions[i] / 6, motions[i] % 6))
    {
      const auto place = std::lower_bound(free.begin(), free.end(), term.dof) - free.begin();
      terms.push_back({i, static_cast<std::size_t>(place), term.factor});
    }
  return terms;
}

/// T^T A T
std::vector<double> congruent(const std::vector<LocalTerm>& terms, const std::vector<double>& A, std::size_t motions,
                              std::size_t free)
{
  std::vector<double> AT(motions * free, 0), result(free * free, 0);
  for (std::size_t i = 0; i < motions; ++i)
    for (const LocalTerm& t : terms) AT[i * free + t.dof] += A[i * motions + t.motion] * t.factor;
  for (const LocalTerm& t : terms)
    for (std::size_t j = 0; j < free; ++j) result[t.dof * free + j] += t.factor * AT[t.motion * free + j];
  return result;
}

void add_block(const Structure& structure, const DofMap& dofs, const Block& block)
{
  const auto free = free_dofs(dofs, block.motions);
  const auto terms = local_terms(dofs, block.motions, free);
  const auto count = static_cast<PetscInt>(free.size());
  const auto add = [&](Mat matrix, const std::vector<double>& A)
  {
    const auto reduced = congruent(terms, A, block.motions.size(), free.size());
    check(MatSetValues(matrix, count, free.data(), count, free.data(), reduced.data(), ADD_VALUES));
  };
  add(structure.M, block.M);
  add(structure.C, block.C);
  add(structure.K, block.K);
}

/// Entries of each of this rank's rows, in the columns it owns and in the others'.
struct RowCounts
{
  std::vector<PetscInt> own, other;
};

RowCounts count_rows(const DofMap& dofs, const std::vector<std::vector<PetscInt>>& cliques)
{
  const auto rows = static_cast<std::size_t>(dofs.last - dofs.first);
  const auto owns = [&](PetscInt dof) { return dof >= dofs.first && dof < dofs.last; };
  std::vector<std::vector<int>> cliques_of(rows);
  for (std::size_t i = 0; i < cliques.size(); ++i)
    for (const PetscInt dof : cliques[i])
      if (owns(dof)) cliques_of[static_cast<std::size_t>(dof - dofs.first)].push_back(static_cast<int>(i));
  RowCounts counts{std::vector<PetscInt>(rows, 0), std::vector<PetscInt>(rows, 0)};
  std::vector<PetscInt> seen_by(static_cast<std::size_t>(dofs.size), -1);
  for (std::size_t row = 0; row < rows; ++row)
    for (const int clique : cliques_of[row])
      for (const PetscInt dof : cliques[static_cast<std::size_t>(clique)])
        if (auto& seen = seen_by[static_cast<std::size_t>(dof)]; seen != static_cast<PetscInt>(row))
        {
          seen = static_cast<PetscInt>(row);
          ++(owns(dof) ? counts.own : counts.other)[row];
        }
  return counts;
}

RowCounts count_rows(const Mesh& mesh, const DofMap& dofs, const std::vector<Block>& lumped)
{
  std::vector<std::vector<PetscInt>> cliques; // those that reach this rank's rows
  const auto keep = [&](const std::vector<int>& motions)
  {
    auto free = free_dofs(dofs, motions);
    const auto mine = std::lower_bound(free.begin(), free.end(), dofs.first);
    if (mine != free.end() && *mine < dofs.last) cliques.push_back(std::move(free));
  };
  for (const Element& element : mesh.elements) keep(motions_of(element));
  for (const Block& block : lumped) keep(block.motions);
  return count_rows(dofs, cliques);
}

Owned<Mat> empty_matrix(const DofMap& dofs, const RowCounts& counts, MPI_Comm comm)
{
  Owned<Mat> A;
  const PetscInt mine = dofs.last - dofs.first;
  check(MatCreate(comm, A.put()));
  check(MatSetSizes(A, mine, mine, dofs.size, dofs.size));
  check(MatSetType(A, MATAIJ));
  check(MatXAIJSetPreallocation(A, 1, counts.own.data(), counts.other.data(), nullptr, nullptr));
  return A;
}

/// The text of the element's failure, empty if there is none.
std::string fill_element(const Mesh& mesh, const Scene& scene, std::size_t index, Block& block)
{
  const Element& element = mesh.elements[index];
  const Part& part = scene.parts[static_cast<std::size_t>(element.part)];
  std::vector<Vec3> x;
  for (int k = 0; k < node_count(element.shape); ++k)
    x.push_back(mesh.nodes[static_cast<std::size_t>(element.nodes[static_cast<std::size_t>(k)])]);
  ElementMatrices matrices;
  try
  {
    matrices = element_matrices(element.shape, x, part.material, part.thickness);
  }
  catch (const std::runtime_error& error)
  {
    return "part " + part.name + ", element " + std::to_string(index) + " with " +
           node_text(element.nodes[0], mesh.nodes[element.nodes[0]]) + ": " + error.what();
  }
  const RayleighDamping damping = part.damping.value_or(scene.damping);
  block.motions = motions_of(element);
  block.M = std::move(matrices.mass);
  block.K = std::move(matrices.stiffness);
  block.C.resize(block.M.size());
  for (std::size_t i = 0; i < block.C.size(); ++i) block.C[i] = damping.alpha * block.M[i] + damping.beta * block.K[i];
  return "";
}

void add_elements(const Structure& structure, const Mesh& mesh, const Scene& scene, const Partition& partition,
                  const DofMap& dofs, MPI_Comm comm)
{
  std::string problem;
  Block block;
  for (std::size_t i = 0; i < mesh.elements.size() && problem.empty(); ++i)
  {
    if (partition.element_rank[i] != rank_of(comm)) continue;
    problem = fill_element(mesh, scene, i, block);
    if (problem.empty()) add_block(structure, dofs, block);
  }
  agree(comm, problem);
}

} // namespace

Structure assemble(const Mesh& mesh, const Scene& scene, const Partition& partition, const DofMap& dofs, MPI_Comm comm)
{
  Structure structure;
  structure.elements = static_cast<long>(mesh.elements.size());
  structure.names = dofs.names;
  const auto lumped = lumped_blocks(mesh, scene);
  {
    const auto counts = count_rows(mesh, dofs, lumped);
    for (Owned<Mat>* A : {&structure.M, &structure.C, &structure.K}) *A = empty_matrix(dofs, counts, comm);
  }
  add_elements(structure, mesh, scene, partition, dofs, comm);
  if (rank_of(comm) == 0)
    for (const Block& block : lumped) add_block(structure, dofs, block);
  for (Mat A : {structure.M.get(), structure.C.get(), structure.K.get()})
  {
    check(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
    check(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
    mark_symmetric(A);
  }
  structure.load = assemble_load(mesh, scene, partition, dofs, comm);
  return structure;
}

} // namespace squeal
