#include "squeal/report/results_folder.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/mesh/mesh_file.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

namespace squeal
{

namespace fs = std::filesystem;

namespace
{

// Names in the place while a run is at work.
constexpr const char* lock_file = ".running";
constexpr const char* partial_folder = ".partial";   // results of a run that goes on
constexpr const char* finished_folder = ".finished"; // results that are moved to their place

/// "2026-01-31T12:00:00.123456Z HOST 4711": time, machine and process tell any two runs apart.
std::string new_identity()
{
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const auto micros = std::chrono::duration_cast<std::chrono::microseconds>(now).count();
  const auto seconds = static_cast<std::time_t>(micros / 1000000);
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  std::array<char, 256> host{};
  gethostname(host.data(), host.size() - 1);
  return format("%04d-%02d-%02dT%02d:%02d:%02d.%06dZ %s %d", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday,
                utc.tm_hour, utc.tm_min, utc.tm_sec, static_cast<int>(micros % 1000000), host.data(),
                static_cast<int>(getpid()));
}

[[noreturn]] void refuse_folder(const fs::path& folder, const std::string& reason)
{
  throw Error("cannot write results to " + folder.string() + " (" + reason +
              "); name a folder you may write to with --output DIR");
}

/// The absolute path without links, dots and a slash at its end.
fs::path resolved(const fs::path& path)
{
  const fs::path whole = fs::weakly_canonical(fs::absolute(path));
  return whole.has_filename() ? whole : whole.parent_path();
}

} // namespace

std::string ResultsFolder::lock()
{
  const fs::path path = place_ / lock_file;
  struct flock whole = {};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  file_ = open(path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
  if (file_ < 0) refuse_folder(place_, std::strerror(errno));
  // a file system without locks refuses otherwise: there two runs into one folder go unseen
  if (fcntl(file_, F_OFD_SETLK, &whole) != 0 && (errno == EAGAIN || errno == EACCES))
  {
    std::array<char, 512> holder{};
    const ssize_t size = read(file_, holder.data(), holder.size() - 1);
    return size > 0 ? holder.data() : "unknown";
  }
  // a run that ended meanwhile has removed its file: the file locked is then not the one that others see
  struct stat locked = {}, there = {};
  if (fstat(file_, &locked) != 0 || stat(path.c_str(), &there) != 0 || locked.st_ino != there.st_ino)
    return "one that is just ending";
  if (ftruncate(file_, 0) != 0 || write(file_, run_.data(), run_.size()) < 0)
    refuse_folder(place_, std::strerror(errno));
  return {};
}

ResultsFolder::ResultsFolder(const fs::path& place, MPI_Comm comm) : comm_(comm)
{
  on_rank_zero(comm,
               [&]
               {
                 try
                 {
                   place_ = resolved(place);
                   make();
                 }
                 catch (const std::exception& failure)
                 {
                   undo();
                   if (const auto* system = dynamic_cast<const fs::filesystem_error*>(&failure))
                     refuse_folder(place, system->code().message());
                   throw;
                 }
               });
  std::string place_text = place_.string(), partial_text = partial_.string();
  for (std::string* text : {&place_text, &partial_text, &run_}) broadcast(*text, comm);
  place_ = place_text;
  partial_ = partial_text;
}

void ResultsFolder::make()
{
  run_ = new_identity();
  const fs::path partial = place_ / partial_folder, finished = place_ / finished_folder;
  made_ = fs::create_directories(place_);
  const bool is_of_a_run = fs::exists(place_ / lock_file) || fs::exists(place_ / word(ResultFile::options));
  for (const char* folder : {partial_folder, finished_folder, word(ResultFile::checkpoints)})
    if (fs::exists(place_ / folder) && !is_of_a_run)
      refuse_folder(place_ / folder, "runs write into a folder of this name, and no run has made this one");
  const std::string holder = lock();
  if (!holder.empty())
    throw Error("another run writes into " + place_.string() + " (" + holder +
                ": its start, machine and process); wait for its end, or name another folder with --output DIR");
  partial_ = partial; // from here on it is ours to remove
  if (fs::exists(finished)) move_finished();
  fs::remove_all(partial);
  fs::create_directory(partial);
}

ResultsFolder::~ResultsFolder()
{
  if (!published_ && !kept_ && rank_of(comm_) == 0) undo();
  if (file_ >= 0) close(file_);
}

void ResultsFolder::undo()
{
  std::error_code ignored;
  if (!partial_.empty()) fs::remove_all(partial_, ignored);
  const bool is_mark = fs::exists(checkpoints(), ignored) && !fs::exists(place_ / word(ResultFile::options), ignored);
  if (!partial_.empty() && !is_mark) fs::remove(place_ / lock_file, ignored); // else it says that a run made them
  if (made_) fs::remove(place_, ignored);                                     // unless something is in it
}

std::string ResultsFolder::keep_finished()
{
  kept_ = is_file(partial_ / word(ResultFile::report));
  return kept_ ? "; the stages that finished left their results in " + partial_.string() +
                     ", which the next run into this place removes"
               : "";
}

/// Goes on where a run that was killed meanwhile had come: the earlier report goes before any result is moved, the new
/// one comes last.
void ResultsFolder::move_finished()
{
  const fs::path from = place_ / finished_folder, report = word(ResultFile::report);
  if (fs::exists(place_ / report)) // then nothing has been moved yet
    for (const fs::path name : words_of<ResultFile>)
      if (name != report && name != word(ResultFile::checkpoints) && !fs::exists(from / name))
        fs::remove_all(place_ / name);
  fs::remove(place_ / report);
  std::vector<fs::path> names;
  for (const auto& entry : fs::directory_iterator(from))
    if (entry.path().filename() != report) names.push_back(entry.path().filename());
  names.push_back(report);
  for (const fs::path& name : names)
  {
    if (fs::is_directory(place_ / name)) fs::remove_all(place_ / name);
    fs::rename(from / name, place_ / name);
  }
  fs::remove(from);
}

void ResultsFolder::publish(Checkpoints checkpoints)
{
  on_rank_zero(comm_,
               [&]
               {
                 fs::path whole = partial_;
                 try
                 {
                   fs::rename(partial_, place_ / finished_folder);
                   whole = place_ / finished_folder;
                   if (checkpoints == Checkpoints::removed) fs::remove_all(this->checkpoints());
                   move_finished();
                   fs::remove(place_ / lock_file);
                 }
                 catch (const fs::filesystem_error& error)
                 {
                   published_ = true; // they are whole, wherever they are
                   throw Error("cannot move the results to " + place_.string() + ": " + error.code().message() +
                               "; they stay in " + whole.string());
                 }
               });
  published_ = true;
}

bool is_same_file(const fs::path& a, const fs::path& b)
{
  std::error_code none;
  return fs::equivalent(a, b, none) || resolved(a) == resolved(b);
}

namespace
{

void append_mesh(const fs::path& file, std::vector<fs::path>& inputs)
{
  const std::vector<fs::path> files = scan_mesh_input(file).files;
  inputs.insert(inputs.end(), files.begin(), files.end());
}

constexpr std::array row_files = {"dofs.txt", "nodes.txt"}; // beside matrices

/// Appends a folder of matrices and the files that are read of it, by their names.
void append_matrices(const fs::path& folder, std::vector<fs::path>& inputs)
{
  const std::size_t first = inputs.size();
  inputs.push_back(folder);
  for (const auto& entry : fs::directory_iterator(folder))
    if (const fs::path name = entry.path().filename();
        name.extension() == ".petsc" || std::ranges::find(row_files, name) != row_files.end())
      inputs.push_back(entry.path());
  std::sort(inputs.begin() + static_cast<std::ptrdiff_t>(first), inputs.end());
}

} // namespace

std::vector<fs::path> inputs_of(const Scene& scene)
{
  std::vector<fs::path> inputs = {scene.file};
  if (scene.mesh) append_mesh(scene.mesh->file, inputs);
  if (scene.mesh && !scene.mesh->size_field.empty()) inputs.push_back(scene.mesh->size_field);
  if (scene.matrices) append_matrices(*scene.matrices, inputs);
  for (const Superelement& superelement : scene.superelements) append_matrices(superelement.folder, inputs);
  if (scene.transient.start.kind == StartKind::file) inputs.push_back(scene.transient.start.file);
  if (scene.cycle.start.kind == CycleStartKind::file) inputs.push_back(scene.cycle.start.file);
  return inputs;
}

void check_outputs(const Scene& scene, const std::vector<fs::path>& inputs, const fs::path& place)
{
  const std::string elsewhere = "name another folder with --output DIR";
  std::vector<fs::path> taken = inputs;
  const auto take = [&](const fs::path& output, const std::string& remedy)
  {
    for (const fs::path& other : taken)
      if (is_same_file(output, other))
        throw Error("the output " + output.string() + " would fall on " + other.string() + ", an input or another " +
                    "output: " + remedy);
    taken.push_back(output);
  };
  for (const char* name : words_of<ResultFile>)
  {
    const fs::path result = place / name;
    if (result.has_extension() && is_folder(result))
      throw Error("the output " + result.string() + " is a folder, which the result would replace: " + elsewhere);
    take(result, elsewhere);
  }
  for (const auto& [key, file] : {std::pair("[transient] save_state", scene.transient.save_state),
                                  std::pair("[cycle] save_state", scene.cycle.save_state)})
    if (!file.empty()) take(file, std::string("give ") + key + " another name");
}

} // namespace squeal
