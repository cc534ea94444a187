#include "squeal/base/checkpoint.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/base/whole_file.hpp"

#include <cstdio>
#include <fstream>
#include <iterator>

namespace squeal
{

namespace fs = std::filesystem;

namespace
{

constexpr const char* request_file = "request.txt";

/// The run's place for checkpoints, as its control the process's own (run_control.hpp).
CheckpointPlace& place()
{
  static CheckpointPlace one;
  return one;
}

void write(const std::string& name, const std::vector<double>& numbers)
{
  try
  {
    fs::create_directories(place().folder);
    if (!fs::exists(place().folder / request_file)) write_whole_file(place().folder / request_file, place().request);
    write_whole_file(place().folder / name,
                     {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(double)});
  }
  catch (const std::exception& error)
  {
    static bool warned = false;
    if (!std::exchange(warned, true))
      std::fprintf(stderr, "squeal: warning: no checkpoint is kept: %s\n", error.what());
  }
}

std::vector<double> read(const std::string& name)
{
  std::ifstream stream(place().folder / name, std::ios::binary);
  std::vector<double> numbers;
  for (double number = 0; stream.read(reinterpret_cast<char*>(&number), sizeof number);) numbers.push_back(number);
  return numbers;
}

[[noreturn]] void refuse_short()
{
  throw Error("the checkpoint is cut short: run again without --restart");
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
    refuse_short();
}

void Checkpoint::pass_size(std::size_t& size)
{
  auto number = static_cast<double>(size);
  pass(number);
  if (reads_ && !(number >= 0 && number <= static_cast<double>(numbers_.size() - next_))) refuse_short();
  size = static_cast<std::size_t>(number);
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
                " are of another scene, of other input files, of other options or of another number of ranks (" +
                file.string() + "): give those, or begin again without --restart");
}

const fs::path& checkpoint_folder()
{
  return place().folder;
}

void keep(const std::string& name, MPI_Comm comm, const Description& describe)
{
  checkpoint_made();
  if (place().folder.empty()) return;
  Checkpoint checkpoint;
  describe(checkpoint);
  if (rank_of(comm) == 0) write(name, checkpoint.numbers());
}

bool restore(const std::string& name, MPI_Comm comm, const Description& describe)
{
  if (!place().restart) return false;
  std::vector<double> numbers;
  if (rank_of(comm) == 0) numbers = read(name);
  broadcast(numbers, comm);
  if (numbers.empty()) return false;
  Checkpoint checkpoint(std::move(numbers));
  describe(checkpoint);
  return true;
}

} // namespace squeal
