#include "squeal/base/whole_file.hpp"

#include "squeal/base/error.hpp"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <sys/statvfs.h>

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

/// Writes a file and closes it; false where the system refuses, with the reason in errno.
bool write(const std::string& path, std::string_view bytes)
{
  std::FILE* const file = std::fopen(path.c_str(), "wbe");
  if (!file) return false;
  const bool whole = std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
  return std::fclose(file) == 0 && whole;
}

} // namespace

void write_whole_file(const fs::path& place, std::string_view bytes)
{
  const std::string draft = place.string() + unfinished_ending;
  if (write(draft, bytes) && std::rename(draft.c_str(), place.c_str()) == 0) return;
  const int code = errno;
  std::remove(draft.c_str());
  refuse(place, bytes.size(), code);
}

} // namespace squeal
