/// Files and parameters of geometries, and the first bytes of mesh files.
#include "squeal/mesh/mesh_file.hpp"

#include "squeal/base/error.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>

namespace squeal
{

namespace fs = std::filesystem;

namespace
{

std::string content_of(const fs::path& file)
{
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

bool is_letter(char c)
{
  return std::isalnum(static_cast<unsigned char>(c)) || c == '_';
}

/// Words, quoted texts with the quote before them, and single characters; without comments.
std::vector<std::string> tokens_of(const std::string& text)
{
  std::vector<std::string> tokens;
  for (std::size_t i = 0, end = 0; i < text.size(); i = end)
  {
    const char c = text[i];
    end = i + 1;
    if (text.compare(i, 2, "//") == 0)
      end = text.find('\n', i);
    else if (text.compare(i, 2, "/*") == 0)
      end = text.find("*/", i + 2) + 1; // the last / is a token without a meaning
    else if (c == '"' || c == '\'')
    {
      end = std::min(text.find(c, i + 1), text.size());
      tokens.push_back(text.substr(i, end - i));
      ++end;
    }
    else if (is_letter(c))
    {
      while (end < text.size() && is_letter(text[end])) ++end;
      tokens.push_back(text.substr(i, end - i));
    }
    else if (!std::isspace(static_cast<unsigned char>(c)))
      tokens.emplace_back(1, c);
    if (end == std::string::npos || end == 0) break; // a comment without an end
  }
  return tokens;
}

/// Appends the names in the list of DefineConstant that begins at `i`, outside of braces: after "[" or ",".
void append_parameters(const std::vector<std::string>& tokens, std::size_t i, std::vector<std::string>& names)
{
  const auto is_one_of = [&](const char* symbols)
  { return tokens[i].size() == 1 && std::string(symbols).find(tokens[i]) != std::string::npos; };
  for (int depth = 0; i < tokens.size(); ++i)
  {
    depth += is_one_of("[{(");
    depth -= is_one_of("]})");
    if (depth == 0) return;
    if (depth == 1 && is_letter(tokens[i][0]) && (tokens[i - 1] == "[" || tokens[i - 1] == ","))
      names.push_back(tokens[i]);
  }
}

void scan(const fs::path& file, MeshInput& input)
{
  input.files.push_back(file);
  const std::vector<std::string> tokens = tokens_of(content_of(file));
  for (std::size_t i = 0; i + 2 < tokens.size(); ++i)
  {
    if (tokens[i] == "DefineConstant") append_parameters(tokens, i + 1, input.parameters);
    const bool include = tokens[i] == "Include", shape = tokens[i] == "ShapeFromFile"; // ShapeFromFile("...")
    const std::string& name = tokens[shape ? i + 2 : i + 1];
    if ((!include && !shape && tokens[i] != "Merge") || (name[0] != '"' && name[0] != '\'')) continue;
    const fs::path target = file.parent_path() / name.substr(1);
    if (!is_file(target) || std::ranges::find(input.files, target) != input.files.end()) continue;
    if (include || is_geometry(target))
      scan(target, input);
    else
      input.files.push_back(target);
  }
}

/// A format that gmsh recognises by the ending, and how its files begin.
struct Format
{
  const char* ending;
  const char* beginning;
};

constexpr std::array formats = {Format{".msh", "$"},          Format{".unv", "-1"},        Format{".vtk", "# vtk"},
                                Format{".step", "ISO-10303"}, Format{".stp", "ISO-10303"}, Format{".med", "\x89HDF"}};

/// The beginning of a file as a message shows it.
std::string quoted(std::string text)
{
  text = text.substr(0, std::min<std::size_t>(text.find_first_of("\r\n"), 40));
  for (char& c : text)
    if (c < ' ' || c > '~') c = '?';
  return "\"" + text + "\"";
}

} // namespace

bool is_geometry(const fs::path& file)
{
  return file.extension() == ".geo" || file.extension() == ".geo_unrolled";
}

MeshInput scan_mesh_input(const fs::path& file)
{
  if (!is_file(file)) throw Error(shortened(file) + ": no such mesh file");
  if (!std::ifstream(file)) throw Error(shortened(file) + ": cannot be read");
  MeshInput input{{}, {file}};
  if (is_geometry(file))
  {
    input.files.clear();
    scan(file, input);
  }
  // gmsh runs the options beside a file after it.
  if (const fs::path options = file.string() + ".opt"; is_file(options)) input.files.push_back(options);
  return input;
}

void check_first_bytes(const fs::path& file)
{
  std::string ending = file.extension().string(), text(64, '\0');
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  std::ifstream stream(file, std::ios::binary);
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(stream.gcount()));
  if (ending == ".unv") text.erase(0, text.find_first_not_of(' '));
  for (const Format& format : formats)
    if (ending == format.ending && !text.starts_with(format.beginning))
      throw Error(shortened(file) + ": it begins with " + quoted(text) + ", where a file of the ending " + ending +
                  " begins with \"" + format.beginning +
                  "\"; gmsh would run it as a script. If it is a geometry, let its name end in .geo");
}

} // namespace squeal
