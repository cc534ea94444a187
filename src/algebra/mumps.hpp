#pragma once
/// MUMPS (Amestoy, Duff, L'Excellent, Koster 2001) through PETSc: the factor of a sparse matrix over its ranks, and
/// such a factor of a positive definite A with a border of rows B beside it. MUMPS's INFOG is the same on all ranks, so
/// that its errors are thrown on all ranks together.
#include "squeal/algebra/pencil_factor.hpp"

namespace squeal
{

struct MumpsSettings
{
  Symmetry symmetry = Symmetry::none;
  const char* prefix = ""; // of the options that MUMPS takes; they come before the settings
  PetscInt room = 30;      // [%] memory beyond MUMPS's estimate to start with
  double pivoting = 0.01;  // CNTL(1): the least pivot over the largest entry of its column; 0: all are taken
};

/// A factor whose members are collective.
class MumpsFactor
{
public:
  /// Analyses the pattern of A, which is borrowed. Throws LibraryError if memory runs out.
  MumpsFactor(Mat A, const MumpsSettings& settings);
  ~MumpsFactor();

  /// Factors A as it is now, with more memory where the estimate was too small. Returns false if A is singular. Throws
  /// LibraryError for any other failure.
  bool factorise();

  /// INFOG(12) of the last factorisation. For Symmetry::symmetric only.
  int negative_pivots() const { return to_int(information(12)); }

  /// A^-1 B and A'^-1 B for this rank's rows of both.
  Eigen::MatrixXd solve(const Eigen::MatrixXd& B) const;
  Eigen::MatrixXd solve_transposed(const Eigen::MatrixXd& B) const;

  /// Entries of the factor, on all ranks together.
  double entries() const { return count(29); }

  /// Memory that the factor takes by the analysis, on all ranks together [bytes].
  double estimated_memory() const;

private:
  void analyse();
  PetscInt information(PetscInt number) const; // INFOG
  double count(PetscInt number) const;         // the same of large numbers

  Mat A_;
  MumpsSettings settings_;
  Owned<Mat> factor_;
};

/// The factor of a positive definite A by MUMPS and the border's rows B. Parts of B A^-1 B' come from solves with rows
/// of B. It has the two halves of a solve of the supernodal factor (cholesky.hpp); each is a whole solve.
class BorderedMumps
{
public:
  /// B may be null.
  BorderedMumps(Mat A, Mat B);

  /// Whether A is not positive definite; the factor is then not to be used.
  bool failed() const { return failed_; }

  /// Gives B A^-1 B' to `take` on rank 0, strip after strip.
  void read_condensed(const std::function<void(const CondensedStrip&)>& take) const;

  /// B A^-1 b for each b, on rank 0; keeps A^-1 b.
  std::vector<double> forward(std::span<const Vec> b);

  /// A^-1 (b - B' lambda) into x; lambda is read on rank 0.
  void backward(const std::vector<double>& lambda, std::span<const Vec> x) const;

  double entries() const { return factor_.entries(); }

private:
  Owned<Mat> B_, transposed_;
  MumpsFactor factor_;
  MultiVector solution_{};
  bool failed_;
};

/// The settings for a positive definite matrix.
MumpsSettings definite_settings();

} // namespace squeal
