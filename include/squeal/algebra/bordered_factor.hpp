#pragma once
/// Direct factor of A (symmetric, meant to be positive definite) bordered by rows B that are never eliminated:
///     [A  B'] [x     ]   [b]
///     [B  0 ] [lambda] = [*]     leaves  -B A^-1 B'  in the corner (Schur complement),
/// and splits a solve in two halves: `forward` turns b into B A^-1 b, `backward` then gives x = A^-1 (b - B' lambda)
/// for a lambda chosen in between. Both together cost less than two solves with A alone.
///
/// supernodal: L L' by supernodes in METIS's ordering, on rank 0, the quickest. mumps: MUMPS in the same ordering,
/// spread over all ranks. dense: by LAPACK on rank 0. Right-hand sides, several at once at will, pass through rank 0.
/// automatic: dense if A is small or full; else supernodal, but mumps on several ranks if rank 0 would hold more than
/// -factor_limit for it. The option -factor names another.
#include "squeal/base/petsc.hpp"

#include <memory>
#include <span>
#include <vector>

namespace squeal
{

class Factor
{
public:
  enum class Kind
  {
    automatic, // as -factor says
    supernodal,
    mumps,
    dense,
  };

  Factor();
  Factor(Factor&&) noexcept;
  Factor& operator=(Factor&&) noexcept;
  ~Factor();

  /// Collective. `B` may be null: no border.
  Factor(Mat A, Mat B, Kind kind);

  /// A pivot was zero or negative: A is not positive definite and the factor is of no use.
  bool failed() const;

  /// scale B A^-1 B', row-major, symmetric to the bit; on rank 0 only, empty elsewhere. Once: it gives its storage
  /// away.
  std::vector<double> condensed(double scale);

  /// B A^-1 b for each b, one after the other; on rank 0 only. `backward` must follow before the next `forward`.
  std::vector<double> forward(std::span<const Vec> b) const;

  /// x = A^-1 (b - B' lambda) for the b of the last `forward`; lambda as `forward` returns, read on rank 0.
  void backward(const std::vector<double>& lambda, std::span<const Vec> x) const;

  double entries() const; // of the triangular factor, the border's rows included

private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// What a Factor of A bordered by B (may be null) holds at its largest; its condensed corner apart [bytes]. Collective.
double factor_memory(Mat A, Mat B);

/// x = A^-1 b.
void solve(const Factor& factor, Vec b, Vec x);

} // namespace squeal
