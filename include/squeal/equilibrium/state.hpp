#pragma once
/// State of the structure (src/README.md, section 1.5): displacements, velocities and the reactions with them. All
/// functions are collective.
#include "squeal/base/checkpoint.hpp"
#include "squeal/base/outcome.hpp"
#include "squeal/contact/interface.hpp"
#include "squeal/solid/structure.hpp"

#include <filesystem>

namespace squeal
{

/// A state of motion, absolute: u and v are not those about the equilibrium.
struct State
{
  Owned<Vec> u, v;               // [m, m/s]
  double time = 0;               // [s]
  std::vector<double> reactions; // [N] of the last step (impulse / h); warm start of the next; empty: none known
  std::vector<double> slip{};    // [m] slip_positions; empty: those of u with the reactions
};

/// A deep copy.
State copy_of(const State& state);

/// x'A y
double product(Vec x, Mat A, Vec y);

/// Scalar energies and norms in the structure's own inner product.
double kinetic_energy(const Structure& structure, Vec v);   // v'Mv/2 [J]
double potential_energy(const Structure& structure, Vec u); // u'Ku/2 [J]

/// Vec u, then Vec v, PETSc binary, in the order of files (file_order.hpp), then the slip positions where there are
/// some. Collective; the file is whole or absent.
void write_state(const State& state, const Structure& structure, const std::filesystem::path& file);

/// Error: the file is missing, does not begin with two PETSc vectors, or is cut short. Error, too: it has another size
/// than the structure, or holds an entry that is not finite.
State read_state(const std::filesystem::path& file, const Structure& structure);

// The order of the degrees of freedom in files, which does not depend on the number of ranks. It is that of a matrix
// scene's matrices, else by node of the mesh and direction (x y z rx ry rz), free ones only.

/// Moves vectors between the ranks and a list on rank 0 in the order of files. All members are collective.
class FileOrder
{
public:
  explicit FileOrder(const Structure& structure);

  /// Returns all entries on rank 0, and nothing elsewhere.
  std::vector<double> gather(Vec x) const;

  /// Sets the vector from the list on rank 0, which has its size; the lists of other ranks are not read.
  void scatter(std::span<const double> entries, Vec x) const;

  /// Moves the vector into the checkpoint that is written, or out of the one that is read.
  void describe(Checkpoint& checkpoint, Vec x) const;

private:
  std::vector<PetscInt> order_; // degrees of freedom in the order of files, on rank 0
};

} // namespace squeal
