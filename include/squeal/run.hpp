#pragma once
/// The whole method, once: mesh -> structure -> equilibrium -> modes -> estimate -> transient -> cycle -> report.
#include "squeal/base/petsc.hpp"
#include "squeal/scene/scene.hpp"

#include <filesystem>

namespace squeal
{

/// Every stage that ran reached what it promised (0), or one did not and the report says which (2). Errors are thrown.
enum class Verdict : int
{
  converged = 0,
  not_converged = 2,
};

/// Runs the chain and writes the results into `output`, which exists.
Verdict run(const Scene& scene, const std::filesystem::path& output, MPI_Comm comm);

/// Checks scene and mesh and prints what the model would be; computes and writes nothing.
void dry_run(const Scene& scene, MPI_Comm comm);

} // namespace squeal
