#include "squeal/base/checkpoint.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/whole_file.hpp"

#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <utility>

namespace squeal
{

namespace fs = std::filesystem;

namespace
{

constexpr std::string_view head = "squeal checkpoint 2\n";

constexpr const char* request_file = "request.txt";

/// The run's place for checkpoints, as its control the process's own (run_control.hpp).
CheckpointPlace& place()
{
  static CheckpointPlace one;
  return one;
}

/// What the names of all checkpoints begin with at present.
std::string& prefix()
{
  static std::string one;
  return one;
}

fs::path file_of(const std::string& name)
{
  return place().folder / (prefix() + name);
}

/// Says once that there is no room for checkpoints.
void warn(const std::string& reason)
{
  static bool warned = false;
  if (!std::exchange(warned, true))
    std::fprintf(stderr, "squeal: warning: no checkpoint is kept: %s\n", reason.c_str());
}

/// Why these bytes are better not written: the last space of a disk is for the results. Empty if there is enough.
std::string lack_of_room(std::size_t bytes)
{
  constexpr double left_for_results = 16e6; // [byte]
  std::error_code unknown;
  const fs::space_info space = fs::space(place().folder.parent_path(), unknown);
  if (unknown || static_cast<double>(space.available) >= static_cast<double>(bytes) + left_for_results) return {};
  return "less than 16 MB would be free in " + place().folder.parent_path().string();
}

} // namespace

std::uint64_t check_sum(std::string_view bytes, std::uint64_t so_far)
{
  for (const char byte : bytes) so_far = (so_far ^ static_cast<unsigned char>(byte)) * 1099511628211ull;
  return so_far;
}

void Checkpoint::pass(double& number)
{
  if (!reads_)
    numbers_.push_back(number);
  else if (next_ < numbers_.size())
    number = numbers_[next_++];
  else
    throw Error("the checkpoint is cut short: run again without --restart");
}

void Checkpoint::pass_size(std::size_t& size)
{
  auto number = static_cast<double>(size);
  pass(number);
  if (reads_ && !(number >= 0 && number <= static_cast<double>(numbers_.size() - next_)))
    throw Error("the checkpoint is cut short: run again without --restart");
  size = static_cast<std::size_t>(number);
}

std::string Checkpoint::bytes() const
{
  std::string bytes(head);
  bytes.append(reinterpret_cast<const char*>(numbers_.data()), numbers_.size() * sizeof(double));
  const std::uint64_t sum = check_sum(bytes);
  bytes.append(reinterpret_cast<const char*>(&sum), sizeof sum);
  return bytes;
}

std::optional<Checkpoint> Checkpoint::from(const std::string& bytes)
{
  std::uint64_t sum = 0;
  if (bytes.size() < head.size() + sizeof sum || !bytes.starts_with(head)) return {};
  const std::string_view content = std::string_view(bytes).substr(0, bytes.size() - sizeof sum);
  std::memcpy(&sum, bytes.data() + content.size(), sizeof sum);
  if (sum != check_sum(content)) return {};
  Checkpoint checkpoint;
  checkpoint.reads_ = true;
  checkpoint.numbers_.resize((content.size() - head.size()) / sizeof(double));
  if (!checkpoint.numbers_.empty()) // else its data may be null, which memcpy must not be given
    std::memcpy(checkpoint.numbers_.data(), content.data() + head.size(), checkpoint.numbers_.size() * sizeof(double));
  return checkpoint;
}

void describe(Checkpoint& checkpoint, std::complex<double>& number)
{
  double real = number.real(), imaginary = number.imag();
  describe_all(checkpoint, real, imaginary);
  number = {real, imaginary};
}

void describe(Checkpoint& checkpoint, std::string& text)
{
  std::vector<char> letters(text.begin(), text.end());
  describe(checkpoint, letters);
  text.assign(letters.begin(), letters.end());
}

void describe(Checkpoint& checkpoint, Outcome& outcome)
{
  describe_all(checkpoint, outcome.kind, outcome.reason, outcome.iterations, outcome.residual);
}

void open_checkpoints(const CheckpointPlace& given)
{
  place() = given;
  const fs::path file = given.folder / request_file;
  std::ifstream stream(file);
  if (!given.restart || !stream) return;
  const std::string theirs{std::istreambuf_iterator<char>(stream), {}};
  if (theirs != given.request)
    throw Error("the checkpoints in " + given.folder.string() +
                " are of another scene, of other input files or of other options (" + file.string() +
                "): give those, or begin again without --restart");
}

CheckpointNames::CheckpointNames(const std::string& given) : before_(prefix())
{
  prefix() += given;
}

CheckpointNames::~CheckpointNames()
{
  prefix() = before_;
}

void CheckpointNames::remove_all()
{
  std::error_code ignored;
  if (prefix().empty()) return;
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(place().folder, ignored))
    if (entry.path().filename().string().starts_with(prefix())) files.push_back(entry.path());
  for (const fs::path& file : files) fs::remove(file, ignored);
}

bool checkpoints_are_kept()
{
  return !place().folder.empty();
}

void keep(const Checkpoint& checkpoint, const std::string& name)
{
  if (!checkpoints_are_kept()) return;
  try
  {
    const std::string bytes = checkpoint.bytes();
    if (const std::string lack = lack_of_room(bytes.size()); !lack.empty()) throw Error(lack);
    fs::create_directories(place().folder);
    if (!fs::exists(place().folder / request_file))
      write_whole_file(place().folder / request_file, place().request, Flush::now);
    write_whole_file(file_of(name), bytes, Flush::now);
  }
  catch (const std::exception& error)
  {
    warn(error.what());
  }
}

namespace
{

std::string bytes_kept(const std::string& name)
{
  if (!place().restart) return {};
  std::ifstream stream(file_of(name), std::ios::binary);
  std::ostringstream bytes;
  if (stream) bytes << stream.rdbuf();
  return bytes.str();
}

} // namespace

std::optional<Checkpoint> kept(const std::string& name)
{
  return Checkpoint::from(bytes_kept(name));
}

void remove_kept(const std::string& name)
{
  std::error_code ignored;
  fs::remove(file_of(name), ignored);
}

std::optional<Checkpoint> kept_everywhere(const std::string& name, MPI_Comm comm)
{
  if (!place().restart) return {};
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  std::string bytes = rank == 0 ? bytes_kept(name) : std::string();
  broadcast(bytes, comm);
  return Checkpoint::from(bytes);
}

} // namespace squeal
