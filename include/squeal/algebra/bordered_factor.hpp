#pragma once
/// Direct factor of A (symmetric, positive definite) bordered by rows B (src/README.md, sections 8.1 to 8.4):
///     [A  B'] [x     ]   [b]
///     [B  0 ] [lambda] = [*]     leaves the Schur complement -B A^-1 B' of the border.
/// B is never eliminated. A solve has two halves: `forward` turns b into B A^-1 b, and `backward` gives x = A^-1 (b -
/// B' lambda) for the caller's lambda. Both together cost less than two solves with A alone. Several right-hand sides
/// are solved at once.
#include "squeal/base/options.hpp"
#include "squeal/base/petsc.hpp"

#include <array>
#include <memory>
#include <span>
#include <vector>

namespace squeal
{

/// How a matrix is factored.
enum class FactorKind
{
  automatic,  // dense if A is small or full; else supernodal, or mumps where FactorOptions::limit says so
  supernodal, // L L' by supernodes in METIS's ordering, subtrees by ranks; the fastest
  mumps,      // MUMPS in the same ordering, spread over all ranks
  dense,      // on rank 0
};

inline constexpr std::array factor_kind_words = {"automatic", "supernodal", "mumps", "dense"};

inline Words words_of(FactorKind)
{
  return factor_kind_words;
}

/// Of every stage that factors a symmetric positive definite matrix.
struct FactorOptions
{
  FactorKind kind = FactorKind::automatic;
  double limit = 4; // [GB] of a rank's share in a supernodal factor; beyond it several ranks take MUMPS
};

OptionList options_of(FactorOptions& options);

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

  /// scale B A^-1 B', row-major, symmetric to the last bit; on rank 0 only, empty elsewhere. Moves its storage out:
  /// call it once.
  std::vector<double> condensed(double scale);

  /// B A^-1 b for each b, one after the other; on rank 0 only. `backward` must follow before the next `forward`.
  std::vector<double> forward(std::span<const Vec> b) const;

  /// x = A^-1 (b - B' lambda) for the b of the last `forward`. lambda has the layout that `forward` returns, and is
  /// read on rank 0.
  void backward(const std::vector<double>& lambda, std::span<const Vec> x) const;

  /// Entries of the triangular factor, with the border's rows but for a dense one. Collective.
  double entries() const;

private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// x = A^-1 b. The factor has no border. Collective.
void solve(const Factor& factor, Vec b, Vec x);

} // namespace squeal
