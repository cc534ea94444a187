#include "squeal/base/whole_file.hpp"

#include "squeal/base/error.hpp"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <sys/statvfs.h>
#include <unistd.h>
#include <utility>

namespace squeal
{

namespace fs = std::filesystem;

namespace
{

bool is_lack_of_space(int code)
{
  return code == ENOSPC || code == EDQUOT || code == EFBIG;
}

/// "; it needs 1.2 MB, and 0.3 MB are free there: ..."
std::string space_text(const fs::path& place, std::size_t needed, int code)
{
  std::string text = format("; the file needs %.3g MB", 1e-6 * static_cast<double>(needed));
  struct statvfs system = {};
  if (statvfs(place.parent_path().empty() ? "." : place.parent_path().c_str(), &system) == 0 && code == ENOSPC)
    text += format(", and %.3g MB are free",
                   1e-6 * static_cast<double>(system.f_bavail) * static_cast<double>(system.f_frsize));
  return text + (code == EFBIG ? ": raise the limit of file sizes (ulimit -f)" : ": make room") +
         ", or name another folder with --output DIR";
}

[[noreturn]] void refuse(const fs::path& place, std::size_t needed, int code)
{
  throw Error("cannot write " + place.string() + ": " + std::strerror(code) +
              (is_lack_of_space(code) ? space_text(place, needed, code) : ""));
}

/// A file in the making, removed unless it is moved to its place.
class Draft
{
public:
  explicit Draft(const fs::path& place)
      : path_(place.string() + unfinished_ending),
        file_(open(path_.c_str(), O_CREAT | O_WRONLY | O_TRUNC | O_CLOEXEC, 0666))
  {
  }
  ~Draft()
  {
    if (file_ >= 0) ::close(file_);
    if (!path_.empty()) unlink(path_.c_str());
  }
  Draft(const Draft&) = delete;
  Draft& operator=(const Draft&) = delete;

  /// Each returns false where the system refuses, with the reason in errno.
  bool is_open() const { return file_ >= 0; }
  bool write(std::string_view bytes, Flush flush)
  {
    while (!bytes.empty())
    {
      const ssize_t written = ::write(file_, bytes.data(), bytes.size());
      if (written < 0 && errno != EINTR) return false;
      if (written > 0) bytes.remove_prefix(static_cast<std::size_t>(written));
    }
    return flush == Flush::by_system || fsync(file_) == 0 || errno == EINVAL; // pipes and devices know no fsync
  }
  bool close() { return ::close(std::exchange(file_, -1)) == 0; }
  bool move_to(const fs::path& place)
  {
    if (std::rename(path_.c_str(), place.c_str()) != 0) return false;
    path_.clear();
    return true;
  }

private:
  std::string path_;
  int file_;
};

} // namespace

void write_whole_file(const fs::path& place, std::string_view bytes, Flush flush)
{
  Draft draft(place);
  if (!draft.is_open() || !draft.write(bytes, flush) || !draft.close() || !draft.move_to(place))
    refuse(place, bytes.size(), errno);
}

} // namespace squeal
