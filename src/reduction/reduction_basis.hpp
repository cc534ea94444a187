#pragma once
/// The shapes that a reduced model is made on (src/README.md, sections 7.1 and 7.2): modes, attachment shapes of the
/// pairs' forces, and the orthonormal basis of both. All functions that take PETSc's objects are collective.
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/equilibrium/linearised_sliding.hpp"
#include "squeal/reduction/reduced_model.hpp"

#include <Eigen/SparseCore>

namespace squeal
{

/// The followed mode is the first; the others nearest to it in frequency. Real and imaginary parts. Then real modes.
/// All as motions Z y that keep the eliminated pairs closed.
MultiVector mode_columns(const std::vector<ComplexMode>& modes, const Reduction& reduction,
                         const ClosedContact& contact);

/// The force of each active pair that slides, a column each: its normal force and friction, on the active pairs' rows
/// of B.
Eigen::SparseMatrix<double> sliding_forces(const Interface& interface, const std::vector<int>& active);

/// P = F'B Z of the forces F, columns on the active pairs' rows.
Owned<Mat> force_rows(const Eigen::SparseMatrix<double>& forces, Mat BZ);

/// The factor and rows that make the shapes Z E^-1 P', a column for each force.
struct Attachments
{
  const Factor& factor; // of E = K_z + w^2 M_z, bordered by P
  Mat Z = nullptr, P = nullptr;
};

/// The part of the attachments that a basis takes.
struct AttachmentLimits
{
  double threshold = 0;     // one is dropped when less than this part of it is new
  Eigen::Index at_most = 0; // the leading ones are taken
  double most_lost = 0;     // mean part of the forces' own compliance that the others may hold
};

/// The basis: the modes, the attachments next to them, all by falling period, as motions. `energy_of_modes`: X'E X of
/// the modes X; `of_modes`: F'B X. Sets the model's counts, what it leaves out (its compliance by forces), M_z and
/// `slow`. Energies of attachments are the condensed operator P E^-1 P', so that only those which the basis takes
/// are solved for. Error: more compliance would be lost than may be.
MultiVector make_basis(ReducedModel& model, const Attachments& attachments, const MultiVector& modes,
                       const Eigen::MatrixXd& energy_of_modes, const Eigen::MatrixXd& of_modes, Mat M,
                       const AttachmentLimits& limits);

} // namespace squeal
