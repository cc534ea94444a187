#pragma once
/// Enums and their words. Beside each enum stands words_of<Enum>, one list of its words in the order of its values.
/// Scene files, options, the printed table and report.json all use that list.
#include <array>
#include <cstddef>
#include <span>

namespace squeal
{

using Words = std::span<const char* const>;

/// The words of an enum.
template <class Enum> extern const std::array<const char*, 0> words_of;

/// The word of an enum's value.
template <class Enum> const char* word(Enum value)
{
  return words_of<Enum>[static_cast<std::size_t>(value)];
}

/// A member of some enum type, read and set by its place in the list of words.
struct Choice
{
  void* member = nullptr;
  Words words;
  std::size_t (*get)(const void* member) = nullptr;
  void (*set)(void* member, std::size_t place) = nullptr;
};

/// The choice that reads and sets this member, which it borrows.
template <class Enum> Choice choice_of(Enum& member)
{
  return {&member, words_of<Enum>, [](const void* m) { return static_cast<std::size_t>(*static_cast<const Enum*>(m)); },
          [](void* m, std::size_t place) { *static_cast<Enum*>(m) = static_cast<Enum>(place); }};
}

} // namespace squeal
