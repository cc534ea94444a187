#pragma once
/// The brake reduced to the modes of its band and the attachment shapes of all pairs (src/README.md, section 7.11).
/// It is a matrix scene that this and other programs read.
#include "squeal/equilibrium/state.hpp"
#include "squeal/modes/modes.hpp"

#include <filesystem>

namespace squeal
{

/// Writes a folder with M K C B .petsc, F gap drive .petsc, of the motion q about the sliding equilibrium, and
/// shapes.petsc with u0.petsc: u = u0 + X q, X's columns one vector after the other, rows in the order of state files.
/// No pair is eliminated. Collective. Error: the file and the system's reason.
void write_reduced_matrices(const SlidingEquilibrium& sliding, const std::vector<ComplexMode>& modes,
                            const FactorOptions& factor, const std::filesystem::path& folder);

} // namespace squeal
