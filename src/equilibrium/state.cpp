/// States: energies, copies, and files. A file is two PETSc binary vectors: class id, length, entries, all big-endian.
#include "squeal/equilibrium/state.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numeric>
#include <system_error>

namespace squeal
{

namespace
{

double half_quadratic_form(Mat A, Vec x)
{
  Owned<Vec> Ax = zeros_like(x);
  check(MatMult(A, x, Ax));
  double product = 0;
  check(VecDot(x, Ax, &product));
  return product / 2;
}

/// A big-endian integer of the width this PETSc writes.
PetscInt read_integer(std::istream& stream, std::size_t width)
{
  PetscInt value = 0;
  for (std::size_t i = 0; i < width; ++i) value = (value << 8) | (stream.get() & 0xff);
  return value;
}

/// What is wrong with a state file, before any rank opens it through PETSc; throws Error.
void check_state_file(const std::filesystem::path& file, PetscInt size)
{
  const std::string name = "state file " + file.string();
  std::ifstream stream(file, std::ios::binary);
  if (!std::filesystem::is_regular_file(file) || !stream)
    throw Error(name + " cannot be read: write one with save_state, or correct the path of transient.start");

  const auto header = static_cast<std::streamoff>(sizeof(int) + sizeof(PetscInt));
  const auto bytes = static_cast<std::streamoff>(std::filesystem::file_size(file));
  std::streamoff at = 0;
  for (const char* part : {"displacement", "velocity"})
  {
    stream.seekg(at);
    const PetscInt id = bytes < at + header ? 0 : read_integer(stream, sizeof(int));
    const PetscInt length = bytes < at + header ? 0 : read_integer(stream, sizeof(PetscInt));
    if (bytes < at + header && at > 0)
      throw Error(name + " ends after the displacement: it must hold two vectors, displacement and velocity");
    if (id != VEC_FILE_CLASSID) throw Error(name + " is not a PETSc binary vector (" + part + ")");
    if (length != size)
      throw Error(name + ": the " + part + " has " + std::to_string(length) + " entries, the structure has " +
                  std::to_string(size) + " degrees of freedom; it was written by another scene or mesh");
    at += header + static_cast<std::streamoff>(sizeof(double)) * size;
    if (bytes < at)
      throw Error(name + " is cut short: " + std::to_string(bytes) + " bytes, the " + part + " ends at byte " +
                  std::to_string(at));
  }
}

/// Between a vector and the same one in the order of a file; the partition numbers the degrees of freedom of a mesh.
Owned<VecScatter> to_file_order(const Structure& structure, Vec x, Vec in_file)
{
  PetscInt first = 0, last = 0, size = 0;
  check(VecGetOwnershipRange(x, &first, &last));
  check(VecGetSize(x, &size));
  std::vector<PetscInt> order(static_cast<std::size_t>(size));
  std::iota(order.begin(), order.end(), 0);
  const std::vector<PetscInt>& nodal_dof = structure.names.nodal_dof;
  if (!nodal_dof.empty())
    std::sort(order.begin(), order.end(), [&](PetscInt a, PetscInt b) { return nodal_dof[a] < nodal_dof[b]; });
  Owned<IS> from, to;
  const MPI_Comm comm = comm_of(x);
  check(ISCreateGeneral(comm, last - first, order.data() + first, PETSC_COPY_VALUES, from.put()));
  check(ISCreateStride(comm, last - first, first, 1, to.put()));
  Owned<VecScatter> scatter;
  check(VecScatterCreate(x, from, in_file, to, scatter.put()));
  return scatter;
}

Owned<PetscViewer> open_binary(MPI_Comm comm, const std::filesystem::path& file, PetscFileMode mode)
{
  Owned<PetscViewer> viewer;
  check(PetscViewerCreate(comm, viewer.put()));
  check(PetscViewerSetType(viewer, PETSCVIEWERBINARY));
  check(PetscViewerBinarySetSkipInfo(viewer, PETSC_TRUE)); // no .info file beside it
  check(PetscViewerFileSetMode(viewer, mode));
  check(PetscViewerFileSetName(viewer, file.c_str()));
  return viewer;
}

void require_finite(Vec x, const std::string& what)
{
  double norm = 0;
  check(VecNorm(x, NORM_1, &norm)); // a sum keeps a NaN of any rank, a maximum may lose it
  if (!std::isfinite(norm)) throw Error(what + " holds entries that are not finite");
}

} // namespace

State copy_of(const State& state)
{
  return {copy_of(state.u.get()), copy_of(state.v.get()), state.time, state.reactions};
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
  const MPI_Comm comm = comm_of(state.u);
  std::filesystem::path draft = file;
  draft += ".part";
  // PETSc opens on one rank: find out there first that it can.
  on_rank_zero(comm,
               [&]
               {
                 if (!std::ofstream(draft, std::ios::binary))
                   throw Error("state file " + draft.string() + " cannot be written: check its folder and rights");
               });
  {
    const Owned<PetscViewer> viewer = open_binary(comm, draft, FILE_MODE_WRITE);
    const Owned<Vec> in_file = zeros_like(state.u);
    const Owned<VecScatter> scatter = to_file_order(structure, state.u, in_file);
    for (Vec x : {state.u.get(), state.v.get()})
    {
      check(VecScatterBegin(scatter, x, in_file, INSERT_VALUES, SCATTER_FORWARD));
      check(VecScatterEnd(scatter, x, in_file, INSERT_VALUES, SCATTER_FORWARD));
      check(VecView(in_file, viewer));
    }
  }
  on_rank_zero(comm,
               [&]
               {
                 std::error_code failure;
                 std::filesystem::rename(draft, file, failure);
                 if (!failure) return;
                 std::filesystem::remove(draft);
                 throw Error("state file " + file.string() + " cannot be written: " + failure.message());
               });
}

State read_state(const std::filesystem::path& file, const Structure& structure)
{
  const MPI_Comm comm = comm_of(structure.load);
  PetscInt size = 0;
  check(VecGetSize(structure.load, &size));
  on_rank_zero(comm, [&] { check_state_file(file, size); });

  State state{zeros_like(structure.load), zeros_like(structure.load), 0, {}};
  const Owned<PetscViewer> viewer = open_binary(comm, file, FILE_MODE_READ);
  const Owned<Vec> in_file = zeros_like(state.u);
  const Owned<VecScatter> scatter = to_file_order(structure, state.u, in_file);
  for (Vec x : {state.u.get(), state.v.get()})
  {
    check(VecLoad(in_file, viewer));
    check(VecScatterBegin(scatter, in_file, x, INSERT_VALUES, SCATTER_REVERSE));
    check(VecScatterEnd(scatter, in_file, x, INSERT_VALUES, SCATTER_REVERSE));
  }
  require_finite(state.u, "state file " + file.string() + ": the displacement");
  require_finite(state.v, "state file " + file.string() + ": the velocity");
  return state;
}

} // namespace squeal
