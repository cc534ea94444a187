#include "squeal/base/error.hpp"

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <new>
#include <numeric>
#include <sstream>
#include <vector>

namespace squeal
{

void agree(MPI_Comm comm, const std::string& problem)
{
  int rank = 0, ranks = 1;
  MPI_Comm_rank(comm, &rank);
  MPI_Comm_size(comm, &ranks);
  const int mine = problem.empty() ? ranks : rank;
  int first = ranks;
  MPI_Allreduce(&mine, &first, 1, MPI_INT, MPI_MIN, comm);
  if (first == ranks) return;
  const bool no_memory = problem == std::bad_alloc().what();
  std::string text = no_memory ? "memory ran out; --dry-run prints a forecast of what a run takes" : problem;
  int length = static_cast<int>(text.size());
  MPI_Bcast(&length, 1, MPI_INT, first, comm);
  text.resize(static_cast<std::size_t>(length));
  MPI_Bcast(text.data(), length, MPI_CHAR, first, comm);
  throw Error(text);
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
  return text.size() <= longest ? text
                                : text.substr(0, longest) + "... (" + std::to_string(text.size()) + " characters)";
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
