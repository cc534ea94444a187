#pragma once
/// Largest multipliers of a reduced model's monodromy matrix on recorded contact, with right and left vectors
/// (src/README.md, sections 6.9 and 7.5). The same on every rank.
#include "squeal/reduction/reduced_tangent.hpp"
#include "squeal/shooting/flow.hpp"

#include <complex>

namespace squeal
{

struct ReducedSpectrum
{
  std::vector<std::complex<double>> values; // largest first, complex pairs whole
  Eigen::MatrixXd right, left;              // orthonormal bases of the right and left vectors' spans, (q, v)
  Eigen::MatrixXd columns;                  // of the monodromy matrix, along the slow coordinates of q and of v
};

/// (Phi - m)^-1 x + x/m of the reduced monodromy matrix with these columns; x: (q, v) of a model of `size` shapes.
Eigen::VectorXcd resolvent(const Eigen::MatrixXd& columns, std::complex<double> m, const Eigen::VectorXcd& x);

/// Which multipliers are wanted.
struct LargeValues
{
  double above = 0; // in modulus
  int at_least = 0, at_most = 0;
};

/// Those that a verdict is about.
inline constexpr LargeValues deciding_values{0.85, 4, 48};

/// Collective among the map's ranks.
ReducedSpectrum large_multipliers(ReducedMap& map, double period, std::span<const RecordedContact> contacts,
                                  const LargeValues& wanted);

/// Columns (q, v) that act on a state by the energy product as these left vectors do by the plain one.
Eigen::MatrixXd energy_representatives(const ReducedModel& model, const Eigen::MatrixXd& left);

/// Sets the errors and rises of the slow motions to what the moduli change by: `moved` are the values on another grid.
void set_changes(const ReducedSpectrum& spectrum, const std::vector<std::complex<double>>& moved, SlowMotions& slow);

/// The multipliers that these vectors give on other contact or with other steps: eigenvalues of (L'R)^-1 L'Phi R, in
/// the order of the spectrum's values. Collective among the map's ranks.
std::vector<std::complex<double>> multipliers_along(const ReducedSpectrum& spectrum, ReducedMap& map, double period,
                                                    std::span<const RecordedContact> contacts);

} // namespace squeal
