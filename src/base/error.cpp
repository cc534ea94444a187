#include "squeal/base/error.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdarg>
#include <cstdio>
#include <new>
#include <numeric>
#include <sstream>
#include <vector>

namespace squeal
{

namespace
{

/// Failed work: its text, and whether memory ran out.
struct Problem
{
  std::string text;
  int no_memory = 0;
};

Problem problem_of(const std::exception_ptr& failure)
{
  if (!failure) return {};
  try
  {
    std::rethrow_exception(failure);
  }
  catch (const std::bad_alloc&)
  {
    return {out_of_memory_text, 1};
  }
  catch (const OutOfMemory& error)
  {
    return {error.what(), 1};
  }
  catch (const std::exception& error)
  {
    return {*error.what() ? error.what() : "unknown failure"};
  }
  catch (const std::string& text) // libgmsh before 4.9 throws strings
  {
    return {text.empty() ? "unknown failure" : text};
  }
  catch (...)
  {
    return {"unknown failure"};
  }
}

void agree_on(MPI_Comm comm, Problem problem)
{
  int rank = 0, ranks = 1;
  MPI_Comm_rank(comm, &rank);
  MPI_Comm_size(comm, &ranks);
  const int mine = problem.text.empty() ? ranks : rank;
  int first = ranks;
  MPI_Allreduce(&mine, &first, 1, MPI_INT, MPI_MIN, comm);
  if (first == ranks) return;
  std::array<int, 2> known = {static_cast<int>(problem.text.size()), problem.no_memory};
  MPI_Bcast(known.data(), 2, MPI_INT, first, comm);
  problem.text.resize(static_cast<std::size_t>(known[0]));
  MPI_Bcast(problem.text.data(), known[0], MPI_CHAR, first, comm);
  if (known[1] != 0) throw OutOfMemory(problem.text);
  throw Error(problem.text);
}

} // namespace

void agree(MPI_Comm comm, const std::string& problem)
{
  agree_on(comm, {problem});
}

void agree(MPI_Comm comm, const std::exception_ptr& failure)
{
  agree_on(comm, problem_of(failure));
}

std::vector<std::string> words_in(const std::string& text)
{
  std::vector<std::string> words;
  std::istringstream stream(text);
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

std::string shortened(const std::string& text)
{
  constexpr std::size_t longest = 300;
  std::string shown = text.substr(0, longest);
  const auto is_control = [](unsigned char c) { return std::iscntrl(c) != 0; };
  std::ranges::replace_if(shown, is_control, '?');
  return text.size() <= longest ? shown : shown + "... (" + std::to_string(text.size()) + " characters)";
}

bool is_file(const std::filesystem::path& name)
{
  std::error_code failed;
  return std::filesystem::is_regular_file(name, failed);
}

bool is_folder(const std::filesystem::path& name)
{
  std::error_code failed;
  return std::filesystem::is_directory(name, failed);
}

std::string problem_of_file(const std::filesystem::path& name)
{
  std::error_code failed;
  if (is_file(name)) return {};
  if (is_folder(name)) return shortened(name) + " is a folder";
  if (std::filesystem::exists(name, failed)) return shortened(name) + " is no plain file";
  if (std::filesystem::is_symlink(std::filesystem::symlink_status(name, failed)))
    return shortened(name) + " is a link to a file that does not exist, or to itself";
  return "there is no file " + shortened(name);
}

std::string format(const char* pattern, ...)
{
  std::va_list arguments, again;
  va_start(arguments, pattern);
  va_copy(again, arguments);
  const int length = std::vsnprintf(nullptr, 0, pattern, arguments);
  va_end(arguments);
  std::string text(static_cast<std::size_t>(std::max(length, 0)), ' ');
  std::vsnprintf(text.data(), text.size() + 1, pattern, again);
  va_end(again);
  return text;
}

int edit_distance(const std::string& a, const std::string& b)
{
  std::vector<int> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 0; i < a.size(); ++i)
  {
    int diagonal = row[0];
    row[0] = static_cast<int>(i) + 1;
    for (std::size_t j = 0; j < b.size(); ++j)
    {
      const int substituted = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({row[j] + 1, row[j + 1] + 1, substituted});
    }
  }
  return row.back();
}

} // namespace squeal
