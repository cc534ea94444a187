#include "mumps_factor.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

// ICNTL(26): the halves of a solve around a Schur complement, or a solve without one.
constexpr int whole_solve = 0, condense = 1, expand_border = 2;

std::size_t area(int rows, int columns)
{
  return static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
}

/// An instance after its analysis. It borrows the entries until the factorisation.
Mumps analysed(BorderedEntries& entries)
{
  Mumps mumps = start_mumps(entries.comm, MumpsSymmetry::symmetric);
  std::vector<MUMPS_INT> order, kept;
  for (const int position : entries.elimination) order.push_back(position + 1);
  for (int i = 0; i < entries.border; ++i) kept.push_back(entries.dofs + i + 1);
  order.insert(order.end(), kept.begin(), kept.end());
  set_entries(mumps, entries.lower, entries.dofs + entries.border);
  control(*mumps, 14) = 1; // [%] increase of the estimated memory: without pivoting the estimate is close
  mumps->cntl[0] = 0;      // no pivoting, since A is positive definite
  mumps->perm_in = order.data();
  if (entries.border > 0)
  {
    control(*mumps, 19) = 1; // the Schur complement whole on rank 0, by rows, with a valid lower triangle
    mumps->size_schur = entries.border;
    mumps->listvar_schur = kept.data();
  }
  set_controls_from_options(*mumps, "factor_");
  run(*mumps, MumpsJob::analyse);
  mumps->perm_in = mumps->listvar_schur = nullptr;
  return mumps;
}

} // namespace

MumpsFactor::MumpsFactor(BorderedEntries entries)
    : dofs_(entries.dofs), border_(entries.border), on_rank_zero_(rank_of(entries.comm) == 0), mumps_(analysed(entries))
{
  if (on_rank_zero_) schur_complement_.resize(area(border_, border_));
  mumps_->schur = schur_complement_.data();
  const bool regular = factorise(*mumps_);
  failed_ = !regular || number_of_negative_pivots(*mumps_) > 0;
  mumps_->irn_loc = mumps_->jcn_loc = nullptr; // `entries` ends with this function
  mumps_->a_loc = nullptr;
}

std::vector<double> MumpsFactor::take_schur_complement()
{
  const auto n = on_rank_zero_ ? static_cast<std::size_t>(border_) : 0;
  for (std::size_t i = 0; i < n; ++i) // MUMPS leaves -B A^-1 B', the lower triangle by rows
    for (std::size_t j = 0; j <= i; ++j) schur_complement_[j * n + i] = -schur_complement_[i * n + j];
  return std::move(schur_complement_);
}

void MumpsFactor::solve_half(int half)
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

std::vector<double> MumpsFactor::forward(const std::vector<double>& b, int columns)
{
  columns_ = columns;
  const auto dofs = static_cast<std::size_t>(dofs_), length = dofs + static_cast<std::size_t>(border_);
  const auto count = on_rank_zero_ ? static_cast<std::size_t>(columns) : 0;
  right_.assign(length * count, 0.);
  reduced_.assign((length - dofs) * count, 0.);
  for (std::size_t k = 0; k < count; ++k) std::copy_n(&b[k * dofs], dofs, &right_[k * length]);
  if (border_ == 0) return {};
  solve_half(condense);
  for (double& value : reduced_) value = -value; // MUMPS leaves 0 - B A^-1 b
  return reduced_;
}

void MumpsFactor::backward(const std::vector<double>& lambda, std::vector<double>& x)
{
  if (on_rank_zero_) reduced_ = lambda;
  solve_half(border_ > 0 ? expand_border : whole_solve);
  const auto dofs = static_cast<std::size_t>(dofs_), length = dofs + static_cast<std::size_t>(border_);
  const auto count = on_rank_zero_ ? static_cast<std::size_t>(columns_) : 0;
  x.resize(dofs * count);
  for (std::size_t k = 0; k < count; ++k) std::copy_n(&right_[k * length], dofs, &x[k * dofs]);
}

double MumpsFactor::entries() const
{
  const int number = information(*mumps_, 29); // a negative one counts millions
  return number < 0 ? -1e6 * number : number;
}

double mumps_factor_memory(BorderedEntries entries)
{
  constexpr double megabyte = 1e6;
  return megabyte * information(*analysed(entries), 17);
}

} // namespace squeal
