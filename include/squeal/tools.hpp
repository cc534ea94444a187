#pragma once

namespace squeal
{

/// Goes on as the tool that the first word names, a file of tools/ beside the program's folder or of its installation;
/// returns where it names none. A scene of this name in the working folder comes first.
void become_tool(int argc, char** argv);

} // namespace squeal
