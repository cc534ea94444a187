#include "point_modes.hpp"

#include "squeal/algebra/dense_matrix.hpp"

#include <algorithm>
#include <boost/pending/disjoint_sets.hpp>
#include <cmath>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <map>

namespace squeal
{

namespace
{

using Eigen::MatrixXcd;
using Places = std::vector<Index>;

/// The vectors of one point, one a column, with zeros for shapes that came later.
MatrixXcd padded(const PointModes& point, Eigen::VectorXcd DenseEigenpair::*side, Index rows)
{
  MatrixXcd result = MatrixXcd::Zero(rows, static_cast<Index>(point.pairs.size()));
  for (std::size_t k = 0; k < point.pairs.size(); ++k)
  {
    const Eigen::VectorXcd& vector = point.pairs[k].*side;
    result.col(static_cast<Index>(k)).head(vector.size()) = vector;
  }
  return result;
}

/// left_i'((lambda_i + lambda_j) M + C) right_j: zero between different modes of one point.
MatrixXcd form(const PointModes& lefts, const PointModes& rights, const PointModes& matrices)
{
  const Index rows = matrices.M.rows();
  const MatrixXcd left = padded(lefts, &DenseEigenpair::left, rows),
                  right = padded(rights, &DenseEigenpair::right, rows);
  MatrixXcd result = left.transpose() * real_times(matrices.M, right);
  for (Index i = 0; i < result.rows(); ++i)
    for (Index j = 0; j < result.cols(); ++j)
      result(i, j) *=
          lefts.pairs[static_cast<std::size_t>(i)].lambda + rights.pairs[static_cast<std::size_t>(j)].lambda;
  return result + left.transpose() * real_times(matrices.C, right);
}

/// The MAC of two subspaces: the least modulus of the eigenvalues of first^-1 there second^-1 back, which are 1 for
/// equal ones. It does not depend on the vectors that span them, which are nearly parallel at lock-in.
double subspace_mac(const ModeForms& forms, const Places& from, const Places& to)
{
  const MatrixXcd first = forms.first(from, from), second = forms.second(to, to);
  const MatrixXcd there = forms.there(from, to), back = forms.back(to, from);
  const MatrixXcd round = first.partialPivLu().solve(there) * second.partialPivLu().solve(back);
  if (!round.allFinite()) return 0;
  const Eigen::ComplexEigenSolver<MatrixXcd> solver(round, false);
  double least = 1;
  for (const Complex value : solver.eigenvalues()) least = std::min(least, folded(std::abs(value)));
  return least;
}

/// Modes that change places among themselves.
struct Cluster
{
  Places from, to;
};

/// The parts of the graph in which modes of both points are linked that share more than a trace, of those that are
/// free.
std::map<std::size_t, Cluster> clusters_of(const MatrixXd& macs, const std::vector<char>& free_from,
                                           const std::vector<char>& free_to)
{
  constexpr double trace = 0.02;
  const int first = static_cast<int>(free_from.size()), second = static_cast<int>(free_to.size());
  boost::disjoint_sets_with_storage<> sets(free_from.size() + free_to.size());
  for (int i = 0; i < first; ++i)
    for (int j = 0; j < second; ++j)
      if (free_from[static_cast<std::size_t>(i)] && free_to[static_cast<std::size_t>(j)] && macs(i, j) >= trace)
        sets.union_set(i, first + j);
  std::map<std::size_t, Cluster> clusters;
  for (int i = 0; i < first; ++i)
    if (free_from[static_cast<std::size_t>(i)]) clusters[sets.find_set(i)].from.push_back(i);
  for (int j = 0; j < second; ++j)
    if (free_to[static_cast<std::size_t>(j)]) clusters[sets.find_set(first + j)].to.push_back(j);
  return clusters;
}

} // namespace

double folded(double ratio)
{
  if (!std::isfinite(ratio)) return 0;
  return ratio > 1 ? 1 / ratio : ratio;
}

MatrixXd all_macs(const ModeForms& forms)
{
  MatrixXd macs(forms.there.rows(), forms.there.cols());
  for (Index i = 0; i < macs.rows(); ++i)
    for (Index j = 0; j < macs.cols(); ++j)
      macs(i, j) = folded(std::abs(forms.there(i, j) * forms.back(j, i) / (forms.first(i, i) * forms.second(j, j))));
  return macs;
}

ModeForms forms_between(const PointModes& from, const PointModes& to)
{
  const PointModes& last = from.M.rows() > to.M.rows() ? from : to; // has all shapes
  return {form(from, to, last), form(to, from, last), form(from, from, last), form(to, to, last)};
}

std::vector<Match> follow(const ModeForms& forms, double clear)
{
  const auto count = static_cast<std::size_t>(forms.first.rows()), next = static_cast<std::size_t>(forms.second.rows());
  std::vector<Match> matches(count);
  if (count == 0 || next == 0) return matches;
  const MatrixXd macs = all_macs(forms);
  std::vector<char> free_from(count, 1), free_to(next, 1);
  const auto match = [&](Index from, Index to, double mac, std::size_t subspace)
  {
    matches[static_cast<std::size_t>(from)] = {static_cast<int>(to), mac, static_cast<int>(subspace)};
    free_from[static_cast<std::size_t>(from)] = free_to[static_cast<std::size_t>(to)] = 0;
  };
  for (Index i = 0, j = 0, back = 0; i < macs.rows(); ++i) // each other's best
    if (macs.row(i).maxCoeff(&j) >= clear && (macs.col(j).maxCoeff(&back), back == i)) match(i, j, macs(i, j), 1);
  for (const auto& [part, cluster] : clusters_of(macs, free_from, free_to))
  {
    const auto& [from, to] = cluster;
    if (from.size() != to.size()) continue;
    const double mac = subspace_mac(forms, from, to);
    if (mac < clear) continue;
    MatrixXd shared = macs(from, to);
    for (std::size_t k = 0; k < from.size(); ++k)
    {
      Index i = 0, j = 0;
      shared.maxCoeff(&i, &j);
      match(from[static_cast<std::size_t>(i)], to[static_cast<std::size_t>(j)], mac, from.size());
      shared.row(i).setConstant(-1);
      shared.col(j).setConstant(-1);
    }
  }
  return matches;
}

namespace
{

/// The mode that grows, of two locked in at one frequency, whichever it is of the two.
std::size_t unstable_partner(const std::vector<DenseEigenpair>& modes, std::size_t mode)
{
  const Complex own = modes[mode].lambda;
  if (is_unstable(own)) return mode;
  const auto locked =
      std::ranges::find_if(modes,
                           [own](const DenseEigenpair& other)
                           {
                             const Complex apart = other.lambda - own;
                             return is_unstable(other.lambda) && std::abs(apart.imag()) < std::abs(apart.real());
                           });
  return locked == modes.end() ? mode : static_cast<std::size_t>(locked - modes.begin());
}

} // namespace

std::vector<int> names_by_shapes(const PointModes& reference, const PointModes& point)
{
  constexpr double least_share = 0.1; // of a mode of the reference, below which it is none of them
  std::vector<int> names(point.pairs.size(), -1);
  if (reference.pairs.empty() || names.empty()) return names;
  const MatrixXd macs = all_macs(forms_between(reference, point));
  for (std::size_t j = 0; j < names.size(); ++j)
  {
    double most = least_share;
    for (std::size_t i = 0; i < reference.pairs.size(); ++i)
    {
      // to be one mode, its stiffness over its mass would have to have changed by so much
      const double change = folded(std::norm(reference.pairs[i].lambda) / std::norm(point.pairs[j].lambda)),
                   alike = macs(static_cast<Index>(i), static_cast<Index>(j)) * change;
      if (alike <= most) continue;
      most = alike;
      names[j] = static_cast<int>(unstable_partner(reference.pairs, i));
    }
  }
  return names;
}

} // namespace squeal
