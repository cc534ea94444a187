#pragma once
/// Checkpoints: lists of numbers from which a run that was killed goes on. Every stage that computes for long keeps its
/// own file of them; all are made on rank 0.
#include "squeal/base/outcome.hpp"

#include <array>
#include <complex>
#include <cstdint>
#include <filesystem>
#include <mpi.h>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace squeal
{

/// FNV-1a, 64 bits, of bytes that follow those of the sum so far.
inline constexpr std::uint64_t empty_check_sum = 14695981039346656037ull;
std::uint64_t check_sum(std::string_view bytes, std::uint64_t so_far = empty_check_sum);

/// A list of numbers that is either written or read: describe() appends a value to the one, and sets it from the other.
class Checkpoint
{
public:
  bool reads() const { return reads_; }

  /// Error: the list that is read has ended.
  void pass(double& number);

  /// Error: the list that is read has not as many left.
  void pass_size(std::size_t& size);

  std::string bytes() const;                                       // with a check sum
  static std::optional<Checkpoint> from(const std::string& bytes); // to be read; nothing: they are damaged

private:
  std::vector<double> numbers_;
  std::size_t next_ = 0; // to be read
  bool reads_ = false;
};

inline void describe(Checkpoint& checkpoint, double& number)
{
  checkpoint.pass(number);
}

template <class Whole>
requires std::is_integral_v<Whole> || std::is_enum_v<Whole>
void describe(Checkpoint& checkpoint, Whole& value)
{
  auto number = static_cast<double>(value);
  checkpoint.pass(number);
  value = static_cast<Whole>(number);
}

template <class Value, std::size_t size> void describe(Checkpoint& checkpoint, std::array<Value, size>& values)
{
  for (Value& value : values) describe(checkpoint, value);
}

template <class Value> void describe(Checkpoint& checkpoint, std::vector<Value>& values)
{
  std::size_t size = values.size();
  checkpoint.pass_size(size);
  values.resize(size);
  for (Value& value : values) describe(checkpoint, value);
}

void describe(Checkpoint& checkpoint, std::complex<double>& number);
void describe(Checkpoint& checkpoint, std::string& text);
void describe(Checkpoint& checkpoint, Outcome& outcome);

template <class... Values> void describe_all(Checkpoint& checkpoint, Values&... values)
{
  (describe(checkpoint, values), ...);
}

/// A list that holds the value.
template <class Value> Checkpoint written(Value value)
{
  Checkpoint checkpoint;
  describe(checkpoint, value);
  return checkpoint;
}

/// The value that a list holds. Error: the list is too short.
template <class Value> Value value_of(Checkpoint checkpoint)
{
  Value value;
  describe(checkpoint, value);
  return value;
}

/// Where a run keeps its checkpoints.
struct CheckpointPlace
{
  std::filesystem::path folder; // made with the first one; none is kept without
  std::string request;          // what the run computes
  bool restart = false;         // those that are there already are read
};

/// Sets the place of this run. Error: the checkpoints to go on from are of another request.
void open_checkpoints(const CheckpointPlace& place);

/// While one lives, the names of this process's checkpoints begin with `prefix` after those of others: work that is
/// done several times in a run keeps its checkpoints apart.
class CheckpointNames
{
public:
  explicit CheckpointNames(const std::string& prefix);
  CheckpointNames(const CheckpointNames&) = delete;
  CheckpointNames& operator=(const CheckpointNames&) = delete;
  ~CheckpointNames();

  /// Removes all that are kept with the prefix.
  static void remove_all();

private:
  std::string before_;
};

/// Whether checkpoints are kept at all.
bool checkpoints_are_kept();

/// Writes one under a name, whole or not at all. A disk that is full is a warning: the run is worth more.
void keep(const Checkpoint& checkpoint, const std::string& name);

/// The one of this name of the run that is gone on with; nothing where there is none.
std::optional<Checkpoint> kept(const std::string& name);

/// Removes the one of this name.
void remove_kept(const std::string& name);

/// The same on every rank. Collective.
std::optional<Checkpoint> kept_everywhere(const std::string& name, MPI_Comm comm);

} // namespace squeal
