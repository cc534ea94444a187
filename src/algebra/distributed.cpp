#include "distributed.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

// ICNTL(26): the halves of a solve around a Schur complement, or a solve without one.
constexpr int whole_solve = 0, condense = 1, expand = 2;

/// Foresees what the elimination takes. `mine` must outlive the factorisation.
Mumps analysed(Triplets& mine, const std::vector<int>& position, int dofs, int border, MPI_Comm comm)
{
  Mumps mumps = start_mumps(comm, 2); // with 1, for positive definite ones, negative pivots would go unseen
  std::vector<MUMPS_INT> order, kept;
  for (const int place : position) order.push_back(place + 1);
  for (int i = 0; i < border; ++i) kept.push_back(dofs + i + 1);
  order.insert(order.end(), kept.begin(), kept.end());
  set_entries(*mumps, mine, dofs + border);
  control(*mumps, 14) = 1; // [%]: without pivoting the estimate is near the truth
  mumps->cntl[0] = 0;      // no pivoting: positive definite
  mumps->perm_in = order.data();
  if (border > 0)
  {
    control(*mumps, 19) = 1; // the corner whole on rank 0, by rows, of which the lower triangle is valid
    mumps->size_schur = border;
    mumps->listvar_schur = kept.data();
  }
  run(*mumps, MumpsJob::analyse);
  mumps->perm_in = mumps->listvar_schur = nullptr;
  return mumps;
}

} // namespace

Distributed::Distributed(Triplets mine, const std::vector<int>& position, int dofs, int border, MPI_Comm comm)
    : dofs_(dofs), border_(border), here_(rank_of(comm) == 0), mumps_(analysed(mine, position, dofs, border, comm))
{
  if (here_) corner_.resize(static_cast<std::size_t>(border) * static_cast<std::size_t>(border));
  mumps_->schur = corner_.data();
  const bool regular = factorise(*mumps_);
  const int negative_pivots = mumps_->infog[11];
  failed_ = !regular || negative_pivots > 0;
  mumps_->irn_loc = mumps_->jcn_loc = nullptr; // they end with `mine`
  mumps_->a_loc = nullptr;
}

std::vector<double> Distributed::take_corner()
{
  const auto n = here_ ? static_cast<std::size_t>(border_) : 0;
  for (std::size_t i = 0; i < n; ++i) // -B A^-1 B', the lower triangle by rows
    for (std::size_t j = 0; j <= i; ++j) corner_[j * n + i] = -corner_[i * n + j];
  return std::move(corner_);
}

void Distributed::solve_half(int half)
{
  control(*mumps_, 26) = half;
  control(*mumps_, 27) = std::max(1, columns_); // all of them at each reading of the factor
  mumps_->rhs = right_.data();
  mumps_->nrhs = columns_;
  mumps_->lrhs = dofs_ + border_;
  mumps_->redrhs = reduced_.data();
  mumps_->lredrhs = border_;
  run(*mumps_, MumpsJob::solve);
}

std::vector<double> Distributed::forward(const std::vector<double>& b, int columns)
{
  columns_ = columns;
  const auto dofs = static_cast<std::size_t>(dofs_), border = static_cast<std::size_t>(border_);
  const auto count = here_ ? static_cast<std::size_t>(columns) : 0;
  right_.assign((dofs + border) * count, 0.);
  reduced_.assign(border * count, 0.);
  for (std::size_t k = 0; k < count; ++k) std::copy_n(&b[k * dofs], dofs, &right_[k * (dofs + border)]);
  if (border == 0) return {};
  solve_half(condense);
  for (double& value : reduced_) value = -value; // MUMPS leaves 0 - B A^-1 b
  return reduced_;
}

void Distributed::backward(const std::vector<double>& lambda, std::vector<double>& x)
{
  if (here_) reduced_ = lambda;
  solve_half(border_ > 0 ? expand : whole_solve);
  const auto dofs = static_cast<std::size_t>(dofs_), length = dofs + static_cast<std::size_t>(border_);
  const auto count = here_ ? static_cast<std::size_t>(columns_) : 0;
  x.resize(dofs * count);
  for (std::size_t k = 0; k < count; ++k) std::copy_n(&right_[k * length], dofs, &x[k * dofs]);
}

double Distributed::entries() const
{
  const int told = mumps_->infog[28]; // negative: in millions
  return told < 0 ? -1e6 * told : told;
}

double distributed_memory(Triplets mine, const std::vector<int>& position, int dofs, int border, MPI_Comm comm)
{
  return 1e6 * analysed(mine, position, dofs, border, comm)->infog[16];
}

} // namespace squeal
