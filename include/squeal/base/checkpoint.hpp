#pragma once
/// Checkpoints: named lists of numbers from which a run that was killed goes on. Every stage that computes for long
/// keeps its own file of them; all are made and read on rank 0.
#include <cstdint>
#include <filesystem>
#include <map>
#include <mpi.h>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace squeal
{

/// FNV-1a, 64 bits, of bytes that follow those of the sum so far.
inline constexpr std::uint64_t empty_check_sum = 14695981039346656037ull;
std::uint64_t check_sum(std::string_view bytes, std::uint64_t so_far = empty_check_sum);

/// Named lists, and their bytes with a check sum.
class Checkpoint
{
public:
  void set(const std::string& name, std::vector<double> values) { lists_[name] = std::move(values); }
  void set(const std::string& name, double value) { lists_[name] = {value}; }
  void set(const std::string& name, const std::vector<int>& values)
  {
    set(name, std::vector<double>(values.begin(), values.end()));
  }

  /// Error: there is no such list, or it is not one number.
  const std::vector<double>& list(const std::string& name) const;
  double number(const std::string& name) const;
  std::vector<int> integers(const std::string& name) const;
  bool has(const std::string& name) const { return lists_.contains(name); }

  std::string bytes() const;                                       // with a check sum
  static std::optional<Checkpoint> from(const std::string& bytes); // nothing: they are damaged

private:
  std::map<std::string, std::vector<double>> lists_;
};

/// Where a run keeps its checkpoints.
struct CheckpointPlace
{
  std::filesystem::path folder; // made with the first one; none is kept without
  std::string request;          // what the run computes
  bool restart = false;         // those that are there already are read
};

/// Sets the place of this run. Error: the checkpoints to go on from are of another request.
void open_checkpoints(const CheckpointPlace& place);

/// While one lives, the names of this process's checkpoints begin with `prefix`: work that is done several times in a
/// run keeps its checkpoints apart.
class CheckpointNames
{
public:
  explicit CheckpointNames(const std::string& prefix);
  CheckpointNames(const CheckpointNames&) = delete;
  CheckpointNames& operator=(const CheckpointNames&) = delete;
  ~CheckpointNames();

  /// Removes all that are kept with the prefix.
  static void remove_all();
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
