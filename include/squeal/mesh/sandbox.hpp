#pragma once
/// The operating system's sandbox of the mesher: files from elsewhere do no harm in it, whatever they hold.

#include <string>

namespace squeal
{

/// Shuts this process in, for good: it starts no program and no other process, opens no connection, and neither writes
/// nor changes a file. What is open stays open. Returns what the kernel leaves open, for a message; empty if nothing.
/// To be called before the process makes threads of its own.
std::string shut_in();

} // namespace squeal
