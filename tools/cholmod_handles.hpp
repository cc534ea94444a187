#pragma once
/// Owning handles of CHOLMOD's objects, and a matrix on its way to CHOLMOD, for tools/bench.
#include "squeal/base/petsc.hpp"

#include <algorithm>
#include <cholmod.h>
#include <memory>
#include <string>

namespace squeal
{

/// CHOLMOD's settings and its account of memory; factors are supernodal.
struct Common : cholmod_common
{
  Common()
  {
    cholmod_start(this);
    supernodal = CHOLMOD_SUPERNODAL;
  }
  ~Common() { cholmod_finish(this); }
  Common(const Common&) = delete;
  Common& operator=(const Common&) = delete;
};

/// Gives an object back to CHOLMOD.
struct Free
{
  Common* common;
  void operator()(cholmod_sparse* A) const { cholmod_free_sparse(&A, common); }
  void operator()(cholmod_dense* X) const { cholmod_free_dense(&X, common); }
  void operator()(cholmod_factor* L) const { cholmod_free_factor(&L, common); }
};

template <class T> using Held = std::unique_ptr<T, Free>;

/// Error: CHOLMOD failed.
template <class T> Held<T> hold(T* object, Common& common)
{
  if (!object || common.status < CHOLMOD_OK) throw Error("CHOLMOD failed: status " + std::to_string(common.status));
  return Held<T>(object, Free{&common});
}

/// A matrix column by column.
struct Columns
{
  std::vector<int> starts = {0}, rows;
  std::vector<double> values;

  void add(PetscInt row, double value)
  {
    rows.push_back(static_cast<int>(row));
    values.push_back(value);
  }
  void end_column() { starts.push_back(static_cast<int>(rows.size())); }
  Held<cholmod_sparse> to_cholmod(std::size_t height, int symmetry, Common& common) const
  {
    Held<cholmod_sparse> A = hold(
        cholmod_allocate_sparse(height, starts.size() - 1, rows.size(), 1, 1, symmetry, CHOLMOD_REAL, &common), common);
    std::copy(starts.begin(), starts.end(), static_cast<int*>(A->p));
    std::copy(rows.begin(), rows.end(), static_cast<int*>(A->i));
    std::copy(values.begin(), values.end(), static_cast<double*>(A->x));
    return A;
  }
};

} // namespace squeal
