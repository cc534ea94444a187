#pragma once
/// Tokens of a geometry script, and the check of its statements.
#include <filesystem>
#include <string>
#include <vector>

namespace squeal
{

struct Token
{
  enum class Kind
  {
    word,
    number,
    text, // in quotes, which are left out
    symbol,
  };
  Kind kind{};
  std::string text;
  int file = 0; // index in Tokens::files
  int line = 0;

  bool is(const char* symbol) const { return kind != Kind::text && text == symbol; }
};

struct Tokens
{
  std::vector<Token> list;
  std::vector<std::filesystem::path> files; // the first one is the script, the others are included
};

/// Returns "file, line N" for messages.
std::string place_of(const Token& token, const Tokens& tokens);

/// Returns the tokens of one file's content, without comments. Throws Error for a character that no statement has.
std::vector<Token> scan(const std::string& content, const std::filesystem::path& file, int file_index);

} // namespace squeal
