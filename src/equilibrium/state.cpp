/// States: energies, copies, and files. A file is two PETSc binary vectors (solid/binary.hpp).
#include "squeal/equilibrium/state.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/whole_file.hpp"
#include "squeal/solid/binary.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numeric>

namespace squeal
{

namespace
{

/// The displacement, velocity and slip positions of a state file, empty ones where it has none. Throws Error.
std::vector<std::vector<double>> parts_of_state(const std::filesystem::path& file, PetscInt size)
{
  const std::string name = "state file " + file.string();
  if (!is_file(file) || !std::ifstream(file))
    throw Error(name + " cannot be read: write one with save_state, or correct the path of start");
  std::vector<std::vector<double>> parts = read_vectors(file);
  if (parts.size() < 2 || parts.size() > 3)
    throw Error(name + format(" has %zu vectors: it must hold two vectors, displacement and velocity, and at most the "
                              "slip positions",
                              parts.size()));
  for (std::size_t i = 0; i < 2; ++i)
    if (std::ssize(parts[i]) != size)
      throw Error(name + format(": the %s has %zu entries, the structure has %td degrees of freedom; it was written by "
                                "another scene or mesh",
                                i == 0 ? "displacement" : "velocity", parts[i].size(), std::ptrdiff_t{size}));
  for (const std::vector<double>& part : parts)
    if (!std::ranges::all_of(part, [](double entry) { return std::isfinite(entry); }))
      throw Error(name + " holds entries that are not finite");
  parts.resize(3);
  return parts;
}

} // namespace

State copy_of(const State& state)
{
  return {copy_of(state.u.get()), copy_of(state.v.get()), state.time, state.reactions, state.slip};
}

double product(Vec x, Mat A, Vec y)
{
  return dot(x, product(A, y));
}

double kinetic_energy(const Structure& structure, Vec v)
{
  return product(v, structure.M, v) / 2;
}

double potential_energy(const Structure& structure, Vec u)
{
  return product(u, structure.K, u) / 2;
}

void write_state(const State& state, const Structure& structure, const std::filesystem::path& file)
{
  const FileOrder order(structure);
  const std::vector<double> u = order.gather(state.u), v = order.gather(state.v);
  on_rank_zero(comm_of(state.u),
               [&]
               {
                 std::string bytes;
                 append_vector(u, bytes);
                 append_vector(v, bytes);
                 if (!state.slip.empty()) append_vector(state.slip, bytes);
                 write_whole_file(file, bytes);
               });
}

State read_state(const std::filesystem::path& file, const Structure& structure)
{
  const MPI_Comm comm = comm_of(structure.load);
  const PetscInt size = entry_count(structure.load);
  std::vector<std::vector<double>> parts(3); // on rank 0
  on_rank_zero(comm, [&] { parts = parts_of_state(file, size); });
  State state{zeros_like(structure.load), zeros_like(structure.load), 0, {}, std::move(parts[2])};
  broadcast(state.slip, comm);
  const FileOrder order(structure);
  order.scatter(parts[0], state.u);
  order.scatter(parts[1], state.v);
  return state;
}

FileOrder::FileOrder(const Structure& structure)
{
  const Vec x = structure.load;
  const PetscInt size = rank_of(comm_of(x)) == 0 ? entry_count(x) : 0;
  order_.resize(static_cast<std::size_t>(size));
  std::iota(order_.begin(), order_.end(), 0);
  const std::vector<PetscInt>& nodal_dof = structure.names.nodal_dof;
  if (!nodal_dof.empty()) // the partition numbers the degrees of freedom of a mesh
    std::ranges::sort(order_, {}, [&](PetscInt dof) { return nodal_dof[static_cast<std::size_t>(dof)]; });
}

std::vector<double> FileOrder::gather(Vec x) const
{
  const std::vector<double> all = all_entries(x);
  std::vector<double> entries;
  for (const PetscInt dof : order_) entries.push_back(all[static_cast<std::size_t>(dof)]);
  return entries;
}

void FileOrder::scatter(std::span<const double> entries, Vec x) const
{
  std::vector<double> all(order_.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[static_cast<std::size_t>(order_[i])] = entries[i];
  broadcast(all, comm_of(x));
  set_all_entries(x, all);
}

void FileOrder::describe(Checkpoint& checkpoint, Vec x) const
{
  std::vector<double> entries;
  if (!checkpoint.reads()) entries = gather(x);
  squeal::describe(checkpoint, entries);
  if (checkpoint.reads()) scatter(entries, x);
}

} // namespace squeal
