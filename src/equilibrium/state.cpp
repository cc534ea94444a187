/// States: energies, copies, and files. A file is two PETSc binary vectors: class id, length, entries, all big-endian.
#include "squeal/equilibrium/state.hpp"

#include "squeal/base/whole_file.hpp"
#include "squeal/equilibrium/file_order.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>

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
  if (!is_file(file) || !stream)
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

/// The order of bytes of a big-endian machine.
template <class Number> void append_big_endian(Number number, std::string& bytes)
{
  std::array<char, sizeof number> own{};
  std::memcpy(own.data(), &number, sizeof number);
  if constexpr (std::endian::native == std::endian::little) std::reverse(own.begin(), own.end());
  bytes.append(own.data(), own.size());
}

/// As a PETSc binary vector.
void append_vector(const std::vector<double>& entries, std::string& bytes)
{
  append_big_endian(static_cast<int>(VEC_FILE_CLASSID), bytes);
  append_big_endian(static_cast<PetscInt>(entries.size()), bytes);
  for (const double entry : entries) append_big_endian(entry, bytes);
}

/// The entries of the next vector of a file that was checked.
std::vector<double> read_entries(std::istream& stream, PetscInt size)
{
  stream.seekg(static_cast<std::streamoff>(sizeof(int) + sizeof(PetscInt)), std::ios::cur);
  std::vector<double> entries(static_cast<std::size_t>(size));
  for (double& entry : entries)
  {
    std::array<char, sizeof entry> bytes{};
    stream.read(bytes.data(), bytes.size());
    if constexpr (std::endian::native == std::endian::little) std::reverse(bytes.begin(), bytes.end());
    std::memcpy(&entry, bytes.data(), sizeof entry);
  }
  return entries;
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
  const FileOrder order(structure);
  const std::vector<double> u = order.gather(state.u), v = order.gather(state.v);
  on_rank_zero(comm_of(state.u),
               [&]
               {
                 std::string bytes;
                 append_vector(u, bytes);
                 append_vector(v, bytes);
                 write_whole_file(file, bytes, Flush::now);
               });
}

State read_state(const std::filesystem::path& file, const Structure& structure)
{
  const MPI_Comm comm = comm_of(structure.load);
  PetscInt size = 0;
  check(VecGetSize(structure.load, &size));
  std::vector<double> u, v; // on rank 0
  on_rank_zero(comm,
               [&]
               {
                 check_state_file(file, size);
                 std::ifstream stream(file, std::ios::binary);
                 u = read_entries(stream, size);
                 v = read_entries(stream, size);
               });
  const FileOrder order(structure);
  State state{zeros_like(structure.load), zeros_like(structure.load), 0, {}};
  order.scatter(u, state.u);
  order.scatter(v, state.v);
  require_finite(state.u, "state file " + file.string() + ": the displacement");
  require_finite(state.v, "state file " + file.string() + ": the velocity");
  return state;
}

} // namespace squeal
