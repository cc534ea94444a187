#include "following.hpp"

#include "squeal/algebra/dense_eigenproblems.hpp"
#include "squeal/algebra/dense_matrix.hpp"

#include <algorithm>
#include <cmath>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Places = std::vector<Index>;

/// The vectors of one point, one a column, with zeros for shapes that came later.
MatrixXcd padded(const PointModes& point, Eigen::VectorXcd TwoSidedPair::*side, Index rows)
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
  const MatrixXcd left = padded(lefts, &TwoSidedPair::left, rows), right = padded(rights, &TwoSidedPair::right, rows);
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

/// Modes that change places among themselves: unmatched ones that share more than a trace.
struct Cluster
{
  Places from, to;
};

/// The entries of both lists that are linked with an entry, by a search through the links.
Cluster linked(const MatrixXd& macs, Index start, const Places& open_from, const Places& open_to)
{
  constexpr double trace = 0.02;
  Cluster cluster{{start}, {}};
  const auto holds = [](const Places& places, Index k)
  { return std::find(places.begin(), places.end(), k) != places.end(); };
  for (bool grown = true; grown;)
  {
    grown = false;
    for (const Index i : open_from)
      for (const Index j : open_to)
      {
        const bool has_i = holds(cluster.from, i), has_j = holds(cluster.to, j);
        if (macs(i, j) < trace || has_i == has_j) continue;
        if (has_i)
          cluster.to.push_back(j);
        else
          cluster.from.push_back(i);
        grown = true;
      }
  }
  return cluster;
}

/// Matches the members of a cluster, the largest MACs first.
void match_within(const Cluster& cluster, const MatrixXd& macs, double mac, std::vector<Match>& matches)
{
  Places from = cluster.from, to = cluster.to;
  while (!from.empty())
  {
    Index best_i = 0, best_j = 0;
    for (Index i = 0; i < static_cast<Index>(from.size()); ++i)
      for (Index j = 0; j < static_cast<Index>(to.size()); ++j)
        if (macs(from[static_cast<std::size_t>(i)], to[static_cast<std::size_t>(j)]) >
            macs(from[static_cast<std::size_t>(best_i)], to[static_cast<std::size_t>(best_j)]))
        {
          best_i = i;
          best_j = j;
        }
    matches[static_cast<std::size_t>(from[static_cast<std::size_t>(best_i)])] = {
        static_cast<int>(to[static_cast<std::size_t>(best_j)]), mac, static_cast<int>(cluster.from.size())};
    from.erase(from.begin() + best_i);
    to.erase(to.begin() + best_j);
  }
}

/// The places of `count` that nothing in `taken` holds.
Places places_left(Index count, const std::vector<char>& taken)
{
  Places places;
  for (Index k = 0; k < count; ++k)
    if (!taken[static_cast<std::size_t>(k)]) places.push_back(k);
  return places;
}

/// Modes that are each other's best, with a clear MAC.
void match_single(const MatrixXd& macs, double clear, std::vector<Match>& matches, std::vector<char>& taken)
{
  for (Index i = 0; i < macs.rows(); ++i)
  {
    Index j = 0, back = 0;
    if (macs.row(i).maxCoeff(&j) < clear) continue;
    macs.col(j).maxCoeff(&back);
    if (back != i) continue;
    matches[static_cast<std::size_t>(i)] = {static_cast<int>(j), macs(i, j), 1};
    taken[static_cast<std::size_t>(j)] = 1;
  }
}

/// Adds to a cluster the matched mode that shares most with it.
void add_neighbour(Cluster& cluster, const MatrixXd& macs, const std::vector<Match>& matches)
{
  double most = 0;
  Index chosen = -1;
  for (Index i = 0; i < macs.rows(); ++i)
  {
    const int to = matches[static_cast<std::size_t>(i)].to;
    if (to < 0 || std::find(cluster.from.begin(), cluster.from.end(), i) != cluster.from.end()) continue;
    double shared = 0;
    for (const Index j : cluster.to) shared = std::max(shared, macs(i, j));
    for (const Index k : cluster.from) shared = std::max(shared, macs(k, to));
    if (shared <= most) continue;
    most = shared;
    chosen = i;
  }
  if (chosen < 0) return;
  cluster.from.push_back(chosen);
  cluster.to.push_back(matches[static_cast<std::size_t>(chosen)].to);
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
  std::vector<char> taken(next, 0);
  match_single(macs, clear, matches, taken);
  std::vector<char> seen(matches.size());
  for (std::size_t i = 0; i < matches.size(); ++i) seen[i] = matches[i].to >= 0;
  for (std::size_t i = 0; i < matches.size(); ++i)
  {
    if (seen[i]) continue;
    Cluster cluster =
        linked(macs, static_cast<Index>(i), places_left(macs.rows(), seen), places_left(macs.cols(), taken));
    for (const Index k : cluster.from) seen[static_cast<std::size_t>(k)] = 1;
    if (cluster.from.size() != cluster.to.size()) continue;
    double mac = subspace_mac(forms, cluster.from, cluster.to);
    if (mac < clear)
    {
      add_neighbour(cluster, macs, matches);
      mac = subspace_mac(forms, cluster.from, cluster.to);
    }
    if (mac < clear) continue;
    match_within(cluster, macs, mac, matches);
    for (const Index k : cluster.to) taken[static_cast<std::size_t>(k)] = 1;
  }
  return matches;
}

namespace
{

/// The mode that grows, of two locked in at one frequency, whichever it is of the two.
std::size_t unstable_partner(const std::vector<TwoSidedPair>& modes, std::size_t mode)
{
  const Complex own = modes[mode].lambda;
  if (is_unstable(own)) return mode;
  const auto locked =
      std::ranges::find_if(modes,
                           [own](const TwoSidedPair& other)
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

std::vector<int> nearest_partners(const std::vector<Complex>& from, const std::vector<Complex>& to)
{
  const bool all = from.size() <= to.size(); // the shorter list has partners
  const std::vector<std::size_t> places = all ? nearest_places(from, to) : nearest_places(to, from);
  std::vector<int> partners(from.size(), -1);
  for (std::size_t k = 0; k < places.size(); ++k)
    if (all)
      partners[k] = static_cast<int>(places[k]);
    else
      partners[places[k]] = static_cast<int>(k);
  return partners;
}

} // namespace squeal
