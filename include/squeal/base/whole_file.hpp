#pragma once
/// Files that exist whole or not at all: written beside their place under another name, then moved.
#include <filesystem>
#include <string_view>

namespace squeal
{

/// Ending of a file's name until it is whole.
inline constexpr const char* unfinished_ending = ".part";

/// Writes a file; one that was there stays until the new one is whole. Error: the file, the system's reason, the space
/// that it needs and the space that is free.
void write_whole_file(const std::filesystem::path& place, std::string_view bytes);

} // namespace squeal
