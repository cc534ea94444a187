#pragma once
/// Direct factor of A (symmetric, positive definite) bordered by rows B (src/README.md, sections 8.1 to 8.4):
///     [A  B'] [x     ]   [b]
///     [B  0 ] [lambda] = [*]     leaves the Schur complement -B A^-1 B' of the border.
/// B is never eliminated. A solve has two halves: `forward` turns b into B A^-1 b, and `backward` gives x = A^-1 (b -
/// B' lambda) for the caller's lambda. Both together cost less than two solves with A alone. MUMPS's factor solves
/// twice, and once for each column of the Schur complement. Several right-hand sides are solved at once.
#include "squeal/base/petsc.hpp"
#include "squeal/base/words.hpp"

#include <array>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <vector>

namespace squeal
{

/// How a matrix is factored.
enum class FactorKind
{
  automatic,  // supernodal, or mumps where FactorOptions::limit says so
  supernodal, // L L' by supernodes in METIS's ordering, subtrees by ranks; the fastest
  mumps,      // MUMPS in the same ordering, spread over all ranks
};

template <> inline constexpr std::array words_of<FactorKind> = {"automatic", "supernodal", "mumps"};

/// The orders of elimination of the last patterns, on the first rank of those that factor.
class KnownAnalyses;

/// One that knows none yet.
std::shared_ptr<KnownAnalyses> no_analyses();

/// The options of every stage that factors a symmetric positive definite matrix.
struct FactorOptions
{
  FactorKind kind = FactorKind::automatic;
  double limit = -1; // [GB] of a rank's share in a supernodal factor; beyond it several ranks take MUMPS; -1: by memory
  double by_memory = std::numeric_limits<double>::infinity(); // [GB] the limit that -1 stands for, of this run

  double share_limit() const { return limit < 0 ? by_memory : limit; } // [GB]
  std::shared_ptr<KnownAnalyses> known{}; // one for all copies; null: every matrix is analysed anew
};

/// Columns `first` to `last` of a symmetric matrix from row `first` on, one after the other, `height` numbers each.
struct CondensedStrip
{
  std::size_t first, last, height;
  const double* values;

  /// row >= column
  double entry(std::size_t row, std::size_t column) const { return values[(column - first) * height + row - first]; }
};

/// The factor of a bordered matrix. Its members are collective.
class Factor
{
public:
  Factor();
  Factor(Factor&&) noexcept;
  Factor& operator=(Factor&&) noexcept;
  ~Factor();

  /// Collective. `B` may be null, for no border.
  Factor(Mat A, Mat B, const FactorOptions& options);

  /// Whether a pivot was zero or negative: A is not positive definite, and the factor is not to be used.
  bool failed() const;

  /// scale B A^-1 B', row-major, symmetric to the last bit; on rank 0 only, empty elsewhere.
  std::vector<double> condensed(double scale) const;

  /// Gives `take` the columns of B A^-1 B' strip after strip, on rank k those from firsts[k] to firsts[k + 1], which
  /// all are the last one or multiples of 24. Without `firsts` all come on rank 0.
  void read_condensed(const std::function<void(const CondensedStrip&)>& take,
                      std::span<const std::size_t> firsts) const;
  void read_condensed(const std::function<void(const CondensedStrip&)>& take) const;

  /// B A^-1 b for each b, one after the other; on rank 0 only. `backward` must follow before the next `forward`.
  std::vector<double> forward(std::span<const Vec> b) const;

  /// x = A^-1 (b - B' lambda) for the b of the last `forward`. lambda has the layout that `forward` returns, and is
  /// read on rank 0.
  void backward(const std::vector<double>& lambda, std::span<const Vec> x) const;

  /// Entries of the triangular factor, with the border's rows.
  double entries() const;

private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// Memory and entries of a matrix's factors, by their symbolic analysis (src/README.md, section 8.9), of all ranks.
struct FactorForecast
{
  FactorKind kind = FactorKind::automatic; // that it will be
  double bytes = 0;                        // of a Factor while it is made, without its Schur complement
  double symmetric = 0;                    // numbers in MUMPS's L D L' of A while it is made
  double working = 0;                      // of these, at most in fronts and waiting updates
  double entries = 0;                      // of L of A alone
  double operations = 0;                   // to make a Factor, on the rank that has most to do
};

/// Forecasts a Factor of A and B, and MUMPS's factors of A in the same order. B may be null. Collective.
FactorForecast forecast_factor(Mat A, Mat B, const FactorOptions& options);

/// x = A^-1 b. The factor has no border. Collective.
void solve(const Factor& factor, Vec b, Vec x);

} // namespace squeal
