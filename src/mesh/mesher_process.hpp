#pragma once
/// The mesher: gmsh in a process of its own, so that its crash is a message.
#include "squeal/mesh/file_mesh.hpp"

#include <map>

namespace squeal
{

/// A file that the mesher is to read.
struct MesherTask
{
  std::string file;
  MesherRights rights{};
  std::map<std::string, double> parameters; // values for DefineConstant
};

/// Runs the mesher and returns its answer. To be called on one rank. Throws Error if it cannot be started, if it is
/// killed by a signal, or if it takes longer than an hour.
MesherAnswer run_mesher(const MesherTask& task);

} // namespace squeal
