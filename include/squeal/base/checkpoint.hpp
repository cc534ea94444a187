#pragma once
/// Checkpoints: lists of numbers from which a run that was killed goes on. A stage describes its state once; the
/// description writes it and reads it. Files are made on rank 0, one for each stage.
#include "squeal/base/finally.hpp"
#include "squeal/base/outcome.hpp"

#include <array>
#include <complex>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mpi.h>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
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
  Checkpoint() = default; // to be written
  explicit Checkpoint(std::vector<double> numbers) : numbers_(std::move(numbers)), reads_(true) {}

  bool reads() const { return reads_; }
  const std::vector<double>& numbers() const { return numbers_; }

  /// Error: the list that is read has ended.
  void pass(double& number);

  /// Error: the list that is read has not as many left.
  void pass_size(std::size_t& size);

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

/// Describes the state of a stage, to be written or read.
using Description = std::function<void(Checkpoint&)>;

/// Where a run keeps its checkpoints.
struct CheckpointPlace
{
  std::filesystem::path folder; // made with the first one; none is kept without
  std::string request;          // what the run computes
  bool restart = false;         // those that are there already are read
};

/// Sets the place of this run. Error: the checkpoints to go on from are of another request.
void open_checkpoints(const CheckpointPlace& place);

/// The folder of the run's checkpoints, for files that a stage needs while it works; empty where a run has none. They
/// leave with the checkpoints.
const std::filesystem::path& checkpoint_folder();

/// Writes a checkpoint under a name, whole or not at all. A disk that is full is a warning: the run is worth more.
/// Collective.
void keep(const std::string& name, MPI_Comm comm, const Description& describe);

/// Sets the state from the checkpoint of the run that is gone on with; false where there is none. Collective.
bool restore(const std::string& name, MPI_Comm comm, const Description& describe);

} // namespace squeal
