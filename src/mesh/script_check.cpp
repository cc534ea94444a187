#include "script_check.hpp"

#include "script_words.hpp"
#include "squeal/base/error.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <set>

namespace squeal
{

namespace
{

constexpr std::array assignments = {"=", "+=", "-=", "*=", "/=", "++", "--"};

class StatementChecker
{
public:
  StatementChecker(const Tokens& tokens, const std::vector<std::string>& constants)
      : tokens_(tokens), list_(tokens.list), defined_(constants.begin(), constants.end())
  {
    find_partners();
  }

  void check_all()
  {
    for (std::size_t i = 0; i < list_.size(); ++i)
      if (defines_name(i)) defined_.insert(list_[i].text);
    for (std::size_t i = 0; i < list_.size(); ++i)
    {
      if (starts_statement(i)) statement_ = i;
      if (list_[i].kind == Token::Kind::word) check_word(i);
      if (list_[i].kind == Token::Kind::text) check_text(i);
      if (starts_statement(i)) check_call(i);
    }
  }

private:
  /// The token at `i`; an empty symbol outside.
  const Token& at(std::size_t i) const
  {
    static const Token none{Token::Kind::symbol, "", 0, 0};
    return i < list_.size() ? list_[i] : none; // i - 1 of the first one wraps around
  }

  /// Sets the place of the bracket that belongs to each bracket. Throws Error for one without a partner.
  void find_partners()
  {
    partner_.resize(list_.size());
    std::vector<std::size_t> open;
    for (std::size_t i = 0; i < list_.size(); ++i)
    {
      const auto closes = [&](const char* closing, const char* opening)
      { return list_[i].is(closing) && !open.empty() && list_[open.back()].is(opening); };
      if (list_[i].is("(") || list_[i].is("[") || list_[i].is("{"))
        open.push_back(i);
      else if (closes(")", "(") || closes("]", "[") || closes("}", "{"))
      {
        partner_[i] = open.back();
        partner_[open.back()] = i;
        open.pop_back();
      }
      else if (list_[i].is(")") || list_[i].is("]") || list_[i].is("}"))
        fail_bracket(i);
    }
    if (!open.empty()) fail_bracket(open.back());
  }

  [[noreturn]] void fail_bracket(std::size_t i) const
  {
    throw Error(place_of(list_[i], tokens_) + ": syntax error: the bracket " + list_[i].text + " has no partner");
  }

  bool starts_statement(std::size_t i) const
  {
    const Token& last = at(i - 1);
    if (i == 0 || last.is(";") || last.is("}")) return true;
    if (last.is(")"))
    {
      const Token& head = at(partner_[i - 1] - 1);
      return head.is("If") || head.is("ElseIf") || head.is("For") || head.is("Macro") || head.is("Function");
    }
    if (last.is("Else") || last.is("EndIf") || last.is("EndFor") || last.is("Return")) return true;
    return at(i - 2).is("Macro") || at(i - 2).is("Function");
  }

  /// The place behind the indices and the ~{...} of a name.
  std::size_t behind_indices(std::size_t i) const
  {
    while (at(i).is("(") || at(i).is("[") || (at(i).is("~") && at(i + 1).is("{")))
      i = partner_[at(i).is("~") ? i + 1 : i] + 1;
    return i;
  }

  bool is_assigned(std::size_t i) const
  {
    const Token& next = at(behind_indices(i + 1));
    return std::any_of(assignments.begin(), assignments.end(), [&](const char* symbol) { return next.is(symbol); });
  }

  bool defines_name(std::size_t i) const
  {
    if (list_[i].kind != Token::Kind::word || is_reserved_word(list_[i].text)) return false;
    const Token& last = at(i - 1);
    if (last.is("For") || last.is("Macro") || last.is("Function")) return true;
    return starts_statement(i) && is_assigned(i);
  }

  /// Whether the word is in Mesh.Color.Lines = Red; or Color Red {...}: any name, but nothing that is called.
  bool names_colour(std::size_t i) const
  {
    const Token &owner = at(statement_), &next = at(i + 1);
    if (next.is("(") || next.is("[") || next.kind == Token::Kind::text) return false;
    const bool options = owner.is("Mesh") || owner.is("Geometry") || owner.is("General");
    return at(i - 1).is("Color") || (options && i > statement_ && at(statement_ + 2).is("Color"));
  }

  void check_word(std::size_t i) const
  {
    const Token& word = list_[i];
    if (names_colour(i))
      return;
    else if (at(i - 1).is("."))
      check_member(i);
    else if (is_allowed_word(word.text))
      check_allowed_word(i);
    else if (at(i - 1).is("(") && at(i - 2).is("Exists") && at(i + 1).is(")"))
      return; // it may ask for any name
    else if (is_reserved_word(word.text) || !defined_.contains(word.text))
      refuse(i, is_reserved_word(word.text) ? "is none of these"
                                            : "is none of these, and no name that the script defines");
    else
      check_name(i);
  }

  /// A name that the script defines must not be used as a command or a function.
  void check_name(std::size_t i) const
  {
    const std::size_t next = i + 1;
    const bool brackets = at(next).is("(") || at(next).is("[");
    if (starts_statement(i) && !is_assigned(i)) refuse(i, "is the name of a variable and no statement");
    if (at(next).kind == Token::Kind::text || (brackets && at(next + 1).kind == Token::Kind::text) || at(next).is("."))
      refuse(i, "is the name of a variable and no function");
  }

  /// A member of the options Mesh, Geometry and General, or of a field.
  void check_member(std::size_t i) const
  {
    const Token& owner = at(i - 2);
    const std::string& member = list_[i].text;
    const bool options = owner.is("Mesh") || owner.is("Geometry") || owner.is("General");
    const bool field = owner.is("]") && at(partner_[i - 2] - 1).is("Field");
    if (!options && !field && !owner.is("Color")) refuse(i, "belongs to options that are none of these");
    if (owner.is("General") && !is_allowed_general_option(member)) refuse(i, "is not among the options");
  }

  /// A text that is the value of an option may be a command.
  void check_text(std::size_t i) const
  {
    const Token& owner = at(statement_);
    const bool options = owner.is("Mesh") || owner.is("Geometry") || owner.is("General");
    if (options && at(statement_ + 1).is(".") && !is_allowed_text_option(at(statement_ + 2).text))
      refuse(i, "is a text, where options take numbers");
  }

  void check_allowed_word(std::size_t i) const
  {
    const Token& word = list_[i];
    if (at(i + 1).is(".") && !word.is("Mesh") && !word.is("Geometry") && !word.is("General") && !word.is("Color"))
      refuse(i, "has no options");
    if (!word.is("Printf") && !word.is("Error") && !word.is("Warning")) return;
    // Printf("...") > "file" writes a file
    const std::size_t bracket = i + 1;
    if (!at(bracket).is("(") || !at(partner_[bracket] + 1).is(";"))
      refuse(i, "must be followed by (...); and by no file");
  }

  /// A macro that calls itself, perhaps through others, may never end, and fills the memory meanwhile.
  void check_call(std::size_t i)
  {
    const std::string& name = at(i + 1).text;
    if (at(i).is("Macro") || at(i).is("Function")) macro_ = name;
    if (at(i).is("Return")) macro_.clear();
    if (macro_.empty() || !at(i).is("Call")) return;
    if (!at(i + 2).is(";")) refuse(i, "must name the macro outright within another one");
    if (calls(name, macro_)) refuse(i, "makes the macro call itself");
    called_[macro_].insert(name);
  }

  /// Whether one macro is the other or calls it, perhaps through others.
  bool calls(const std::string& caller, const std::string& other) const
  {
    std::set<std::string> reached = {caller};
    for (std::vector<std::string> next = {caller}; !next.empty();)
    {
      const auto found = called_.find(next.back());
      next.pop_back();
      if (found == called_.end()) continue;
      for (const std::string& name : found->second)
        if (reached.insert(name).second) next.push_back(name);
    }
    return reached.contains(other);
  }

  [[noreturn]] void refuse(std::size_t i, const std::string& why) const
  {
    std::string statement;
    for (std::size_t k = statement_; k < list_.size() && statement.size() < 60; ++k)
    {
      const bool text = list_[k].kind == Token::Kind::text, tight = list_[k].kind == Token::Kind::symbol;
      if (!statement.empty() && !tight && list_[k - 1].kind != Token::Kind::symbol) statement += ' ';
      statement += text ? '"' + list_[k].text + '"' : list_[k].text;
      if (list_[k].is(";")) break;
    }
    if (statement.size() > 80) statement = statement.substr(0, 77) + "...";
    throw Error(place_of(list_[i], tokens_) + ": the statement  " + statement +
                "  is refused: a geometry may hold shapes, sizes, physical groups, constants and loops, and '" +
                list_[i].text.substr(0, 60) + "' " + why +
                ". Remove it, or let gmsh run whatever the file holds by --allow-scripts");
  }

  const Tokens& tokens_;
  const std::vector<Token>& list_;
  std::vector<std::size_t> partner_;
  std::set<std::string> defined_;
  std::size_t statement_ = 0;                           // the first token of the statement at work
  std::string macro_;                                   // the macro at work; empty outside
  std::map<std::string, std::set<std::string>> called_; // the macros that each one calls
};

} // namespace

void check_statements(const Tokens& tokens, const std::vector<std::string>& constants)
{
  StatementChecker(tokens, constants).check_all();
}

} // namespace squeal
