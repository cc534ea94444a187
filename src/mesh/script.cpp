/// Geometry scripts with their included files, and the signatures of mesh files.
#include "squeal/mesh/script.hpp"

#include "script_check.hpp"
#include "script_words.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <iterator>
#include <optional>

namespace squeal
{

namespace fs = std::filesystem;

namespace
{

// Bounds that no geometry written by hand or by a tool comes near, so that reading ends on any input.
constexpr std::uintmax_t largest_script = 16 << 20; // [byte]
constexpr std::size_t most_tokens = 8 << 20;
constexpr std::size_t deepest_include = 20;

/// The first bytes of a file. Throws Error if it is no plain file that can be read.
std::string beginning_of(const fs::path& file, std::size_t length)
{
  if (!is_file(file)) throw Error(shortened(file) + ": no such mesh file");
  std::ifstream stream(file, std::ios::binary);
  std::string text(length, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(length));
  if (!stream && !stream.eof()) throw Error(shortened(file) + ": cannot be read");
  text.resize(static_cast<std::size_t>(stream.gcount()));
  return text;
}

class ScriptReader
{
public:
  explicit ScriptReader(Statements statements) : statements_(statements) {}

  void read(const fs::path& file)
  {
    if (open_.size() > deepest_include)
      throw Error(shortened(file) + ": it is included more than " + std::to_string(deepest_include) + " files deep");
    std::error_code code;
    const std::string text = beginning_of(file, largest_script + 1);
    if (text.size() > largest_script) throw Error(shortened(file) + ": a geometry script has at most 16 MB");
    const fs::path place = fs::canonical(file, code);
    if (std::find(open_.begin(), open_.end(), place) != open_.end())
      throw Error(shortened(file) + ": it includes itself");
    open_.push_back(place);
    tokens_.files.push_back(file);
    add(scan(text, file, static_cast<int>(tokens_.files.size()) - 1), file);
    open_.pop_back();
  }

  const Tokens& tokens() const { return tokens_; }

  /// The scripts, then the meshes and shapes that they merge.
  std::vector<fs::path> files() const
  {
    std::vector<fs::path> all = tokens_.files;
    all.insert(all.end(), merged_.begin(), merged_.end());
    return all;
  }

private:
  void add(std::vector<Token> tokens, const fs::path& file)
  {
    for (std::size_t i = 0; i < tokens.size(); ++i)
    {
      Token& token = tokens[i];
      const bool include = token.is("Include"), merge = token.is("Merge"), shape = token.is("ShapeFromFile");
      if (tokens_.list.size() > most_tokens) throw Error(shortened(file) + ": with its included files it is too long");
      if (include || merge || shape)
      {
        const std::size_t name = shape ? i + 2 : i + 1; // ShapeFromFile("...")
        const bool named = name + 1 < tokens.size() && tokens[name].kind == Token::Kind::text &&
                           tokens[name + 1].is(shape ? ")" : ";");
        if (!named && statements_ == Statements::any) continue;
        if (!named) throw Error(place_of(token, tokens_) + ": " + token.text + " needs the name of a file in quotes");
        const fs::path target = file.parent_path() / tokens[name].text;
        if (add_file(token, target)) // its text stands in the place of the statement
        {
          i = name + 1;
          continue;
        }
        tokens[name].text = fs::absolute(target).string();
        scan('"' + tokens[name].text + '"', file, tokens[name].file); // a name that no text can hold is refused
      }
      tokens_.list.push_back(std::move(token));
    }
  }

  /// Adds the text of an included or merged script. Returns false if the file is a mesh or a shape.
  bool add_file(const Token& statement, const fs::path& target)
  {
    try
    {
      if (!statement.is("Include") && !is_script(target))
      {
        merged_.push_back(target);
        return false;
      }
      if (statement.is("ShapeFromFile")) throw Error("it is no shape");
      read(target);
    }
    catch (const Error& error)
    {
      if (statements_ == Statements::any) return true;
      throw Error(place_of(statement, tokens_) + ": " + statement.text + ": " + error.what());
    }
    return true;
  }

  Statements statements_;
  Tokens tokens_;
  std::vector<fs::path> open_;   // files that are being read
  std::vector<fs::path> merged_; // that are no scripts
};

/// Names in the lists of DefineConstant, outside of braces: after "[" or ",".
std::vector<std::string> parameters_in(const std::vector<Token>& tokens)
{
  std::vector<std::string> names;
  for (std::size_t i = 0; i + 1 < tokens.size(); ++i)
  {
    if (!tokens[i].is("DefineConstant") || !tokens[i + 1].is("[")) continue;
    int depth = 0;
    for (++i; i < tokens.size(); ++i)
    {
      depth += tokens[i].is("[") || tokens[i].is("{") || tokens[i].is("(");
      depth -= tokens[i].is("]") || tokens[i].is("}") || tokens[i].is(")");
      if (depth == 0) break;
      if (depth == 1 && tokens[i].kind == Token::Kind::word && (tokens[i - 1].is("[") || tokens[i - 1].is(",")))
        names.push_back(tokens[i].text);
    }
  }
  return names;
}

/// The tokens as text. Those of the script stand on its own lines, so that gmsh's messages have its line numbers.
std::string text_of(const Tokens& tokens)
{
  std::string text;
  int line = 1;
  for (const Token& token : tokens.list)
  {
    if (token.file == 0 && token.line > line) text.append(static_cast<std::size_t>(token.line - line), '\n');
    if (token.file == 0) line = std::max(line, token.line);
    text += token.kind == Token::Kind::text ? '"' + token.text + '"' : token.text;
    text += ' ';
  }
  return text + '\n';
}

/// A format that gmsh recognises by the ending, and how its files begin; no beginning: by the ending alone.
struct Format
{
  std::array<const char*, 4> endings; // as gmsh compares them, by letter case
  std::array<const char*, 3> beginnings;
};

constexpr std::array formats = {
    Format{{".msh", ".MSH", ".msh2", ".msh4"}, {"$MeshFormat", "$NO", "$Comments"}},
    Format{{".unv", ".UNV"}, {"    -1", "-1"}},
    Format{{".vtk", ".VTK"}, {"# vtk"}},
    Format{{".step", ".stp", ".STEP", ".STP"}, {"ISO-10303"}},
    Format{{".iges", ".igs", ".IGES", ".IGS"}, {}},
    Format{{".brep"}, {}},
    Format{{".stl", ".STL"}, {}},
    Format{{".bdf", ".nas", ".BDF", ".NAS"}, {}},
    Format{{".mesh", ".MESH"}, {}},
    Format{{".med", ".MED"}, {"\x89HDF"}},
};

bool is_one_of(const std::string& ending, const Format& format)
{
  return std::any_of(format.endings.begin(), format.endings.end(),
                     [&](const char* known) { return known && ending == known; });
}

/// The beginning of a file as a message shows it.
std::string quoted(std::string text)
{
  text = text.substr(0, std::min<std::size_t>(text.find_first_of("\r\n"), 40));
  for (char& c : text)
    if (c < ' ' || c > '~') c = '?';
  return "\"" + text + "\"";
}

} // namespace

bool is_script(const fs::path& file)
{
  const std::string ending = file.extension().string(), text = beginning_of(file, 64);
  std::error_code code;
  if (fs::path options = file.string() + ".opt"; fs::exists(options, code))
    throw Error(shortened(options) + ": gmsh would run this file of options after " + file.filename().string() +
                "; put what the mesh needs into the geometry, and move the file away");
  if (ending == ".geo" || ending == ".geo_unrolled")
  {
    if (text.empty() || text[0] != '$') return true;
    throw Error(shortened(file) + ": it ends in " + ending + " but begins with " + quoted(text) +
                ": a mesh ends in .msh");
  }
  for (const Format& format : formats)
  {
    if (!is_one_of(ending, format)) continue;
    const auto fits = [&](const char* beginning) { return beginning && text.rfind(beginning, 0) == 0; };
    if (!format.beginnings[0] || std::any_of(format.beginnings.begin(), format.beginnings.end(), fits)) return false;
    throw Error(shortened(file) + ": it begins with " + quoted(text) + ", where a file of the ending " + ending +
                " begins with \"" + format.beginnings[0] +
                "\"; gmsh would run it as a script. If it is a geometry, let its name end in .geo");
  }
  throw Error(shortened(file) +
              ": its ending is that of no mesh or geometry: .geo, .msh, .unv, .vtk, .bdf, .nas, .med, "
              ".mesh, .step, .stp, .iges, .igs, .brep, .stl");
}

Script read_script(const fs::path& file, Statements statements)
{
  ScriptReader reader(statements);
  reader.read(file);
  Script script{{}, parameters_in(reader.tokens().list), reader.files()};
  if (statements == Statements::any) return script;
  check_statements(reader.tokens(), script.parameters);
  script.text = text_of(reader.tokens());
  return script;
}

} // namespace squeal
