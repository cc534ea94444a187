#pragma once
/// The harmonic problem and its transpose on one real orthonormal basis V (src/README.md, section 13):
///     Q(omega) x = b,  Q(omega)'w = c,     Q(omega) = K + i K_loss + i omega C - omega^2 M
///     V'Q V a = V'b,   V'Q'V d = V'c,      H = c'V a
/// Norms of the residuals Q V a - b are estimated by products with random vectors S, section 10.2.
#include "squeal/algebra/multivector.hpp"

#include <array>
#include <complex>
#include <span>
#include <vector>

namespace squeal
{

/// The end of a response at which the force of either problem acts.
enum class ResponseEnd
{
  driven, // Q x = b
  read,   // Q'w = c
};

/// What belongs to one of the two problems.
struct HarmonicSide
{
  std::vector<Mat> matrices{}; // M, C, K and, with loss factors, K_loss; borrowed. Of ResponseEnd::read the transposes
  MultiVector forces;          // b or c, in columns
  std::vector<double> sizes{}; // of the unit forces that the columns come from [N]
};

/// Two problems with the 1-norms of their matrices.
struct HarmonicProblem
{
  std::array<HarmonicSide, 2> sides{};
  std::vector<double> norms{}; // in the order of the matrices

  const HarmonicSide& of(ResponseEnd side) const { return sides[static_cast<std::size_t>(side)]; }
};

/// A basis with what it makes of both problems.
struct HarmonicBasis
{
  const HarmonicProblem& problem;
  MultiVector V, S;
  std::vector<Eigen::MatrixXd> products{};                // V'A V
  std::array<std::vector<Eigen::MatrixXd>, 2> sketches{}; // S'A V and S'A'V
  std::array<Eigen::MatrixXd, 2> forces{}, sketched{};    // V'b and V'c, S'b and S'c

  Eigen::Index size() const { return V.columns(); }
};

/// Without a shape. Borrows the problem. Collective.
HarmonicBasis make_harmonic_basis(const HarmonicProblem& problem);

/// Appends what X adds to the span. Returns the number of shapes gained. Collective.
Eigen::Index extend(HarmonicBasis& basis, MultiVector X);

/// What the basis gives at a list of frequencies, one a column.
struct HarmonicScan
{
  Eigen::MatrixXcd receptance; // H: rows c within b
  Eigen::MatrixXd residuals;   // |Q x - b| of all b, then |Q'w - c| of all c, over the unit force
  Eigen::MatrixXd defects;     // the same over what is allowed
  Eigen::Index driven = 0;     // number of b, the first rows of both

  /// Of each frequency, the geometric mean of the largest value of either problem.
  Eigen::RowVectorXd means_of(const Eigen::MatrixXd& rows) const
  {
    const Eigen::RowVectorXd largest = rows.topRows(driven).colwise().maxCoeff();
    return largest.cwiseProduct(rows.bottomRows(rows.rows() - driven).colwise().maxCoeff()).cwiseSqrt();
  }
};

/// Each rank solves frequencies of its own; all have the result. `size`: the number of shapes taken, the first ones.
/// `tolerance`: residual allowed; rounding is allowed in any case. Collective.
HarmonicScan scan(const HarmonicBasis& basis, std::span<const double> omega, Eigen::Index size, double tolerance);

/// Q(s) x of a complex x, or Q(s)'x of ResponseEnd::read. Two columns: real and imaginary part. Collective.
MultiVector dynamic_image(const HarmonicSide& side, std::complex<double> s, const MultiVector& x);

/// Coefficients of all x and of all w at omega, in columns, on the first `size` shapes.
std::array<Eigen::MatrixXcd, 2> solve_at(double omega, const HarmonicBasis& basis, Eigen::Index size);

/// The residual of one force at omega for the coefficients a: real and imaginary part. Collective.
MultiVector residual_of(const HarmonicBasis& basis, ResponseEnd side, Eigen::Index force, double omega,
                        const Eigen::VectorXcd& a);

} // namespace squeal
