/// Scanner of gmsh's language, after Gmsh.l of gmsh. The longest symbol wins, texts stand in double or single quotes,
/// and comments are those of C++. It looks at every character once, so it ends on any input.
#include "script_tokens.hpp"

#include "squeal/base/error.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <string_view>

namespace squeal
{

namespace
{

constexpr std::array symbols = {
    "...", "+=", "-=", "*=", "/=", "||", "&&", "++", "--", "==", "!=", "<=", ">=", ">>", "<<", "+", "-", "*", "/", "%",
    "^",   "=",  "<",  ">",  "!",  "?",  ":",  ";",  ",",  "(",  ")",  "[",  "]",  "{",  "}",  "#", "~", ".", "&"};
constexpr std::size_t longest_word = 200; // gmsh copies names into fixed lengths

bool is_letter(char c)
{
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
}

bool is_digit(char c)
{
  return c >= '0' && c <= '9';
}

class Scanner
{
public:
  Scanner(std::string_view content, const std::filesystem::path& file, int file_index)
      : content_(content), file_(file), file_index_(file_index)
  {
  }

  std::vector<Token> tokens()
  {
    while (place_ < content_.size())
      if (!skip_blank()) add_token();
    return std::move(tokens_);
  }

private:
  char at(std::size_t place) const { return place < content_.size() ? content_[place] : '\0'; }

  [[noreturn]] void fail(const std::string& problem) const
  {
    throw Error(file_.string() + ", line " + std::to_string(line_) + ": " + problem);
  }

  /// Passes a space or a comment. Returns whether there was one.
  bool skip_blank()
  {
    const std::string_view two = content_.substr(place_, 2);
    std::size_t end = place_;
    if (std::strchr(" \t\n\r\f", content_[place_]) && content_[place_])
      end = place_ + 1;
    else if (two == "//")
      end = std::min(content_.find('\n', place_), content_.size());
    else if (two == "/*")
    {
      end = content_.find("*/", place_ + 2);
      if (end == std::string_view::npos) fail("the comment that begins here has no end");
      end += 2;
    }
    else
      return false;
    line_ += static_cast<int>(std::count(content_.begin() + place_, content_.begin() + end, '\n'));
    place_ = end;
    return true;
  }

  void add_token()
  {
    const char c = content_[place_];
    if (is_letter(c))
      add(Token::Kind::word, word_end());
    else if (is_digit(c) || (c == '.' && is_digit(at(place_ + 1))))
      add(Token::Kind::number, number_end());
    else if (c == '"' || c == '\'')
      add_text(c);
    else
      add_symbol();
  }

  void add(Token::Kind kind, std::size_t end)
  {
    tokens_.push_back({kind, std::string(content_.substr(place_, end - place_)), file_index_, line_});
    place_ = end;
  }

  std::size_t word_end() const
  {
    std::size_t end = place_;
    while (is_letter(at(end)) || is_digit(at(end))) ++end;
    if (end - place_ > longest_word)
      fail("a name has " + std::to_string(end - place_) + " characters; " + std::to_string(longest_word) +
           " are allowed");
    return end;
  }

  std::size_t digits_end(std::size_t place) const
  {
    while (is_digit(at(place))) ++place;
    return place;
  }

  std::size_t number_end() const
  {
    std::size_t end = digits_end(place_);
    if (at(end) == '.' && content_.substr(end, 3) != "...") end = digits_end(end + 1);
    if (at(end) != 'e' && at(end) != 'E') return end;
    const std::size_t digits = end + 1 + (at(end + 1) == '+' || at(end + 1) == '-');
    return is_digit(at(digits)) ? digits_end(digits) : end;
  }

  void add_text(char quote)
  {
    const std::size_t end = content_.find(quote, place_ + 1);
    if (end == std::string_view::npos) fail("the text that begins here has no end");
    const std::string text(content_.substr(place_ + 1, end - place_ - 1));
    check_text(text);
    tokens_.push_back({Token::Kind::text, text, file_index_, line_});
    place_ = end + 1;
  }

  /// gmsh reads the text between If and EndIf raw when it skips it, and cuts texts at 1023 characters.
  void check_text(const std::string& text) const
  {
    if (text.size() > 1000) fail("a text has more than 1000 characters");
    for (const char c : text)
      if (std::iscntrl(static_cast<unsigned char>(c)) || c == '"' || c == '\\')
        fail("a text goes over the end of its line, or holds a quote, a backslash or a control character");
    for (const char* control : {"//", "/*", "*/", "EndIf", "EndFor", "Else", "Return"})
      if (text.find(control) != std::string::npos)
        fail("the text \"" + text + "\" holds " + control + ", which gmsh may take for a part of the script");
  }

  void add_symbol()
  {
    for (const char* symbol : symbols)
      if (content_.compare(place_, std::strlen(symbol), symbol) == 0)
        return add(Token::Kind::symbol, place_ + std::strlen(symbol));
    const auto code = static_cast<unsigned char>(content_[place_]);
    fail(std::isprint(code) ? std::string("the character ") + content_[place_] + " has no meaning in a geometry"
                            : format("the byte 0x%02x has no meaning in a geometry", code));
  }

  std::string_view content_;
  const std::filesystem::path& file_;
  int file_index_;
  std::size_t place_ = 0;
  int line_ = 1;
  std::vector<Token> tokens_;
};

} // namespace

std::string place_of(const Token& token, const Tokens& tokens)
{
  return tokens.files[token.file].string() + ", line " + std::to_string(token.line);
}

std::vector<Token> scan(const std::string& content, const std::filesystem::path& file, int file_index)
{
  return Scanner(content, file, file_index).tokens();
}

} // namespace squeal
