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

double half_quadratic_form(Mat A, Vec x)
{
  return dot(x, product(A, x)) / 2;
}

/// What is wrong with a state file, before any rank opens it through PETSc; throws Error.
void check_state_file(const std::filesystem::path& file, PetscInt size)
{
  const std::string name = "state file " + file.string();
  std::ifstream stream(file, std::ios::binary);
  if (!is_file(file) || !stream)
    throw Error(name + " cannot be read: write one with save_state, or correct the path of start");

  const auto header = static_cast<std::streamoff>(vector_header_size);
  const auto bytes = static_cast<std::streamoff>(std::filesystem::file_size(file));
  std::streamoff at = 0;
  for (const char* part : {"displacement", "velocity"})
  {
    if (bytes < at + header && at > 0)
      throw Error(name + " ends after the displacement: it must hold two vectors, displacement and velocity");
    stream.seekg(at);
    const std::optional<PetscInt> length = read_vector_header(stream);
    if (!length) throw Error(name + " is not a PETSc binary vector (" + part + ")");
    if (*length != size)
      throw Error(name + ": the " + part + " has " + std::to_string(*length) + " entries, the structure has " +
                  std::to_string(size) + " degrees of freedom; it was written by another scene or mesh");
    at += header + static_cast<std::streamoff>(sizeof(double)) * size;
    if (bytes < at)
      throw Error(name + " is cut short: " + std::to_string(bytes) + " bytes, the " + part + " ends at byte " +
                  std::to_string(at));
  }
  if (bytes == at) return;
  stream.seekg(at);
  const std::optional<PetscInt> length = read_vector_header(stream);
  if (!length || bytes != at + header + static_cast<std::streamoff>(sizeof(double)) * *length)
    throw Error(name + ": what follows the velocity is no whole vector of slip positions; write the state anew");
}

/// The entries of the next vector of a file that was checked.
std::vector<double> next_vector(std::istream& stream)
{
  const std::optional<PetscInt> length = read_vector_header(stream);
  return read_vector_entries(stream, *length);
}

void require_finite(Vec x, const std::string& what)
{
  const double norm = norm_of(x, NORM_1); // a sum keeps a NaN of any rank, a maximum may lose it
  if (!std::isfinite(norm)) throw Error(what + " holds entries that are not finite");
}

} // namespace

State copy_of(const State& state)
{
  return {copy_of(state.u.get()), copy_of(state.v.get()), state.time, state.reactions, state.slip};
}

double kinetic_energy(const Structure& structure, Vec v)
{
  return half_quadratic_form(structure.M, v);
}

double potential_energy(const Structure& structure, Vec u)
{
  return half_quadratic_form(structure.K, u);
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
  std::vector<double> u, v, slip; // on rank 0
  on_rank_zero(comm,
               [&]
               {
                 check_state_file(file, size);
                 std::ifstream stream(file, std::ios::binary);
                 u = next_vector(stream);
                 v = next_vector(stream);
                 if (stream.peek() != std::ifstream::traits_type::eof()) slip = next_vector(stream);
               });
  broadcast(slip, comm);
  const FileOrder order(structure);
  State state{zeros_like(structure.load), zeros_like(structure.load), 0, {}, std::move(slip)};
  order.scatter(u, state.u);
  order.scatter(v, state.v);
  require_finite(state.u, "state file " + file.string() + ": the displacement");
  require_finite(state.v, "state file " + file.string() + ": the velocity");
  if (!std::ranges::all_of(state.slip, [](double position) { return std::isfinite(position); }))
    throw Error("state file " + file.string() + ": the slip positions hold entries that are not finite");
  return state;
}

FileOrder::FileOrder(const Structure& structure)
{
  const Vec x = structure.load;
  const PetscInt size = rank_of(comm_of(x)) == 0 ? entry_count(x) : 0;
  std::vector<PetscInt> order(static_cast<std::size_t>(size));
  std::iota(order.begin(), order.end(), 0);
  const std::vector<PetscInt>& nodal_dof = structure.names.nodal_dof;
  if (!nodal_dof.empty()) // the partition numbers the degrees of freedom of a mesh
    std::sort(order.begin(), order.end(), [&](PetscInt a, PetscInt b) { return nodal_dof[a] < nodal_dof[b]; });
  Owned<IS> from, to;
  check(ISCreateGeneral(PETSC_COMM_SELF, size, order.data(), PETSC_COPY_VALUES, from.put()));
  check(ISCreateStride(PETSC_COMM_SELF, size, 0, 1, to.put()));
  check(VecCreateSeq(PETSC_COMM_SELF, size, whole_.put()));
  check(VecScatterCreate(x, from, whole_, to, scatter_.put()));
}

std::vector<double> FileOrder::gather(Vec x) const
{
  check(VecScatterBegin(scatter_, x, whole_, INSERT_VALUES, SCATTER_FORWARD));
  check(VecScatterEnd(scatter_, x, whole_, INSERT_VALUES, SCATTER_FORWARD));
  const PetscScalar* values = nullptr;
  check(VecGetArrayRead(whole_, &values));
  std::vector<double> entries(values, values + entry_count(whole_));
  check(VecRestoreArrayRead(whole_, &values));
  return entries;
}

void FileOrder::scatter(std::span<const double> entries, Vec x) const
{
  set_all_entries(whole_, entries); // of which there are none but on rank 0
  check(VecScatterBegin(scatter_, whole_, x, INSERT_VALUES, SCATTER_REVERSE));
  check(VecScatterEnd(scatter_, whole_, x, INSERT_VALUES, SCATTER_REVERSE));
}

void FileOrder::describe(Checkpoint& checkpoint, Vec x) const
{
  std::vector<double> entries;
  if (!checkpoint.reads()) entries = gather(x);
  squeal::describe(checkpoint, entries);
  if (checkpoint.reads()) scatter(entries, x);
}

} // namespace squeal
