#pragma once
/// fields.h5 and fields.xdmf: mesh, equilibrium, unstable modes, one period of the cycle.
#include "squeal/report/report.hpp"

namespace squeal
{

/// Collective. A matrix scene has no nodes and leaves no such files.
void write_fields(const Report& report, const Scene& scene, const Model& model, const std::filesystem::path& output,
                  MPI_Comm comm);

} // namespace squeal
