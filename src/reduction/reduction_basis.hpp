#pragma once
/// The shapes that a reduced model is made on (src/README.md, sections 7.1 and 7.2): modes, attachment shapes of the
/// pairs' forces, and the orthonormal basis of both. All functions that take PETSc's objects are collective.
#include "squeal/reduction/reduced_model.hpp"

#include <Eigen/SparseCore>

namespace squeal
{

/// The entries of X = Z y in the coordinates y. `pattern`: a vector of the structure's.
MultiVector kept_entries(const MultiVector& X, Mat Z, Vec pattern);

/// Shapes of modes, then further ones. Those of the modes kept apart are the last ones.
struct ModeColumns
{
  MultiVector columns;
  Eigen::Index more = 0, apart = 0; // numbers of further shapes, and of those kept apart
};

/// The followed mode is the first; the others nearest to it in frequency. Real and imaginary parts. Then real modes.
/// Those kept apart are the last ones.
ModeColumns mode_columns(const std::vector<ComplexMode>& modes, const Reduction& reduction, Mat Z);

/// The force of each active pair that slides, one column each: its normal force and the friction that follows it, on
/// the active pairs' rows of B.
Eigen::SparseMatrix<double> sliding_forces(const Interface& interface, const std::vector<int>& active);

/// (K_z + w^2 M_z)^-1 (rows)' forces; `rows`: B Z of the active pairs. Error: A = K_z + w^2 M_z is not positive
/// definite.
MultiVector attachment_columns(Mat A, Mat rows, const Eigen::SparseMatrix<double>& forces,
                               const FactorOptions& options);

/// Orthonormal combinations of shapes that are orthonormal in the energy, by falling period: u'M u against the energy.
/// `mass`: of the shapes. Sets `slow` to the number of those that swing by less than four times omega [rad/s].
Eigen::MatrixXd by_falling_period(const Eigen::MatrixXd& mass, double omega, Eigen::Index& slow);

/// The numbers of columns before the attachments, and of those among them that are further shapes or kept apart, which
/// are the last ones.
struct ModeCounts
{
  Eigen::Index modes = 0, more = 0, apart = 0;
};

/// Replaces the columns by the basis: the modes, the attachments next to them, all by falling period. `energy`: X'E X
/// of the columns X, E = K_z + omega^2 M_z. Sets the model's counts, `slow` and `apart`.
void choose_basis(ReducedModel& model, const Eigen::MatrixXd& energy, Mat M_z, MultiVector& columns,
                  const ModeCounts& counts, double threshold);

} // namespace squeal
