#include "squeal/report/results_folder.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/error.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/base/whole_file.hpp"
#include "squeal/mesh/mesh_file.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
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

constexpr const char* lock_file = "running";
constexpr const char* partial_ending = ".partial";  // of the folder beside the place
constexpr const char* earlier_folder = ".replaced"; // the results that are replaced, while they are

bool is_result(const fs::path& name)
{
  return std::find(words_of<ResultFile>.begin(), words_of<ResultFile>.end(), name) != words_of<ResultFile>.end();
}

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

/// Refuses a place that another folder beside it cannot replace.
void refuse_fixed(const fs::path& place)
{
  struct stat own = {}, parent = {};
  const fs::path above = place.parent_path();
  if (stat(above.c_str(), &parent) != 0) return; // it will be made
  if (access(above.c_str(), W_OK) != 0) refuse_folder(place, above.string() + ": " + std::strerror(errno));
  if (stat(place.c_str(), &own) != 0) return;
  if (own.st_dev != parent.st_dev) refuse_folder(place, "results replace the folder, and this one is a mount point");
  if (std::error_code none; fs::equivalent(place, fs::current_path(), none))
    refuse_folder(place, "results replace the folder, and this one is the working folder");
}

bool holds_only_results(const fs::path& folder)
{
  const fs::directory_iterator entries(folder);
  return std::all_of(begin(entries), end(entries),
                     [](const fs::directory_entry& entry) { return is_result(entry.path().filename()); });
}

/// Refuses a partial folder that no run has made: what it holds would be removed.
void refuse_foreign(const fs::path& partial)
{
  if (fs::is_symlink(partial)) refuse_folder(partial, "it is a link, and runs work in a folder of this name");
  if (!fs::exists(partial) || fs::exists(partial / lock_file)) return;
  if (!fs::is_directory(partial)) refuse_folder(partial, "it is no folder, and runs work in one of this name");
  if (!holds_only_results(partial))
    refuse_folder(partial, "runs work in a folder of this name, and it holds files of another origin");
}

/// The absolute path without links, dots and a slash at its end.
fs::path resolved(const fs::path& path)
{
  const fs::path whole = fs::weakly_canonical(fs::absolute(path));
  return whole.has_filename() ? whole : whole.parent_path();
}

[[noreturn]] void refuse_move(const fs::path& from, const fs::path& to, const std::string& reason)
{
  throw Error("cannot move " + from.string() + " to " + to.string() + ": " + reason +
              "; the results stay where they are");
}

void rename_or_throw(const fs::path& from, const fs::path& to)
{
  if (std::rename(from.c_str(), to.c_str()) != 0) refuse_move(from, to, std::strerror(errno));
}

} // namespace

std::string ResultsFolder::lock(const fs::path& folder)
{
  const fs::path path = folder / lock_file;
  struct flock whole = {};
  whole.l_type = F_WRLCK;
  whole.l_whence = SEEK_SET;
  file_ = open(path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
  if (file_ < 0) refuse_folder(folder, std::strerror(errno));
  // a file system without locks refuses otherwise: there two runs into one folder go unseen
  if (fcntl(file_, F_OFD_SETLK, &whole) != 0 && (errno == EAGAIN || errno == EACCES))
  {
    std::array<char, 512> holder{};
    const ssize_t size = read(file_, holder.data(), holder.size() - 1);
    return size > 0 ? holder.data() : "unknown";
  }
  // a run that ended meanwhile has moved its folder away: the file locked is then another one's
  struct stat locked = {}, there = {};
  if (fstat(file_, &locked) != 0 || stat(path.c_str(), &there) != 0 || locked.st_ino != there.st_ino)
    return "one that is just ending";
  if (ftruncate(file_, 0) != 0 || write(file_, run_.data(), run_.size()) < 0)
    refuse_folder(folder, std::strerror(errno));
  return {};
}

ResultsFolder::ResultsFolder(const fs::path& place, Beginning beginning, MPI_Comm comm) : comm_(comm)
{
  on_rank_zero(comm,
               [&]
               {
                 try
                 {
                   place_ = resolved(place);
                   make(beginning);
                 }
                 catch (const fs::filesystem_error& error)
                 {
                   undo();
                   refuse_folder(place, error.code().message());
                 }
                 catch (...)
                 {
                   undo();
                   throw;
                 }
               });
  std::string place_text = place_.string(), partial_text = partial_.string();
  for (std::string* text : {&place_text, &partial_text, &run_}) broadcast(*text, comm);
  place_ = place_text;
  partial_ = partial_text;
}

void ResultsFolder::make(Beginning beginning)
{
  run_ = new_identity();
  if (fs::exists(place_) && (!fs::is_directory(place_) || access(place_.c_str(), W_OK) != 0))
    refuse_folder(place_, fs::is_directory(place_) ? std::strerror(EACCES) : std::strerror(ENOTDIR));
  if (place_.extension() == partial_ending)
    refuse_folder(place_, std::string("runs into a folder without ") + partial_ending + " use this name meanwhile");
  if (fs::is_symlink(place_)) refuse_folder(place_, "it is a link to what does not exist");
  for (fs::path above = place_.parent_path(); above.has_relative_path(); above = above.parent_path())
    if (above.extension() == partial_ending && fs::exists(above / lock_file))
      refuse_folder(place_, "a run works in " + above.string());
  refuse_fixed(place_);
  const fs::path partial = place_.string() + partial_ending;
  fs::create_directories(partial.parent_path());
  refuse_foreign(partial);
  const bool is_new = fs::create_directory(partial);
  std::string holder;
  try
  {
    holder = lock(partial);
  }
  catch (...)
  {
    if (is_new) partial_ = partial; // to be removed
    throw;
  }
  if (!holder.empty())
    throw Error("another run writes into " + place_.string() + " (" + holder +
                ": its start, machine and process); wait for its end, or name another folder with --output DIR");
  if (const fs::path earlier = partial / earlier_folder; fs::exists(earlier)) // a run was killed in publish
  {
    if (fs::exists(place_)) refuse_folder(place_, earlier.string() + " holds its earlier results: move them away");
    rename_or_throw(earlier, place_);
  }
  partial_ = partial; // from here on it is ours to remove
  remove_earlier();
  const bool goes_on = beginning == Beginning::from_checkpoints;
  for (const auto& entry : fs::directory_iterator(partial_))
    if (entry.path().filename() != lock_file && !(goes_on && entry.path() == checkpoints()))
      fs::remove_all(entry.path());
  copied_ = goes_on && !fs::exists(checkpoints()) && fs::exists(place_ / checkpoints().filename());
  if (copied_) fs::copy(place_ / checkpoints().filename(), checkpoints(), fs::copy_options::recursive);
}

ResultsFolder::~ResultsFolder()
{
  if (!published_ && !kept_ && rank_of(comm_) == 0) undo();
  if (file_ >= 0) close(file_);
}

void ResultsFolder::undo()
{
  std::error_code ignored;
  if (!partial_.empty() && !copied_ && fs::exists(checkpoints(), ignored)) return; // --restart goes on from them
  if (!partial_.empty()) fs::remove_all(partial_, ignored);
}

std::string ResultsFolder::keep_finished()
{
  kept_ = is_file(partial_ / word(ResultFile::report));
  return kept_ ? "; the stages that finished left their results in " + partial_.string() +
                     ", which the next run into this place removes"
               : "";
}

fs::path ResultsFolder::meanwhile(const fs::path& file) const
{
  if (file.empty()) return file;
  const fs::path inside = resolved(file).lexically_relative(place_);
  return inside.empty() || *inside.begin() == ".." || inside.has_parent_path() ? file : partial_ / inside;
}

/// Removes the results that were replaced, here or by a run that was killed meanwhile. Files of another origin, such as
/// pictures, are taken along.
void ResultsFolder::remove_earlier()
{
  const fs::path earlier = place_ / earlier_folder;
  std::error_code failed;
  std::vector<fs::path> names;
  for (const auto& entry : fs::directory_iterator(earlier, failed)) names.push_back(entry.path().filename());
  for (const fs::path& name : names)
    if (!is_result(name) && !fs::exists(place_ / name) && !failed) fs::rename(earlier / name, place_ / name, failed);
  if (!failed) fs::remove_all(earlier, failed); // else the next run tries again
}

void ResultsFolder::publish(Checkpoints checkpoints)
{
  on_rank_zero(comm_,
               [&]
               {
                 published_ = true; // whatever happens: the results are whole
                 try
                 {
                   if (fs::exists(place_) && !fs::is_directory(place_))
                     refuse_move(partial_, place_, std::strerror(ENOTDIR)); // it has come there meanwhile
                   if (checkpoints == Checkpoints::removed) fs::remove_all(this->checkpoints());
                   if (fs::exists(place_)) rename_or_throw(place_, partial_ / earlier_folder);
                   rename_or_throw(partial_, place_);
                   remove_earlier();
                 }
                 catch (const fs::filesystem_error& error)
                 {
                   refuse_move(partial_, place_, error.code().message());
                 }
                 std::error_code ignored;
                 fs::remove(place_ / lock_file, ignored);
               });
  published_ = true;
}

bool is_used_meanwhile(const fs::path& file, const fs::path& place)
{
  if (file.parent_path() != place) return file == place.string() + partial_ending;
  return file.filename() == lock_file || file.filename() == earlier_folder || file.extension() == unfinished_ending;
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
  if (scene.mesh && !scene.cycle.coarse_mesh.empty()) append_mesh(scene.cycle.coarse_mesh, inputs);
  if (scene.matrices) append_matrices(*scene.matrices, inputs);
  for (const Superelement& superelement : scene.superelements) append_matrices(superelement.folder, inputs);
  if (scene.transient.start.kind == StartKind::file) inputs.push_back(scene.transient.start.file);
  if (scene.cycle.start.kind == CycleStartKind::file) inputs.push_back(scene.cycle.start.file);
  return inputs;
}

void check_outputs(const Scene& scene, const std::vector<fs::path>& inputs, const fs::path& place)
{
  std::error_code failed;
  if (!fs::exists(place, failed) && failed) // a name that is too long, a link to itself
    throw Error("the output " + shortened(place) + ": " + failed.message() + ": name another folder with --output DIR");
  std::vector<fs::path> results;
  for (const char* name : words_of<ResultFile>)
    if (results.push_back(place / name); results.back().has_extension() && is_folder(results.back()))
      throw Error("the output " + results.back().string() +
                  " is a folder, which the result would replace: name another folder with --output DIR");
  for (const ResultFile folder : {ResultFile::reduced, ResultFile::checkpoints})
    if (is_folder(place / word(folder)) && !is_file(place / word(ResultFile::options)))
      throw Error("the output " + place.string() + " holds a folder '" + word(folder) +
                  "' that no run has made: name another folder with --output DIR");
  const auto refuse_on = [](const fs::path& output, const std::vector<fs::path>& others, const std::string& remedy)
  {
    for (const fs::path& other : others)
      if (is_same_file(output, other))
        throw Error("the output " + output.string() + " would fall on " + other.string() + ": " + remedy);
  };
  for (const fs::path& result : results)
    refuse_on(result, inputs, "the run reads that file; name another folder with --output DIR");
  for (const auto& [key, file] : {std::pair("[transient] save_state", scene.transient.save_state),
                                  std::pair("[cycle] save_state", scene.cycle.save_state)})
  {
    if (file.empty()) continue;
    refuse_on(file, inputs, std::string("the run reads that file; give ") + key + " another name");
    refuse_on(file, results, std::string("a result has that name; give ") + key + " another one");
  }
  const fs::path &one = scene.transient.save_state, &other = scene.cycle.save_state;
  if (!one.empty() && !other.empty())
    refuse_on(one, {other}, "[transient] save_state and [cycle] save_state must be two files");
}

} // namespace squeal
