#pragma once
/// The keys of a scene as a page of Markdown.
#include <string>

namespace squeal
{

/// Returns a table for each table of a scene: its keys, units, defaults, what a value must be, what a change of it
/// changes, and what it means.
std::string scene_page();

} // namespace squeal
