/// W before any b: the natural map's scales, and the near field. In a step as short as an element's transit W decays
/// with distance; a longer step, or a body that moves as one, does not let it, and the near field is all of W.
#include "squeal/base/error.hpp"
#include "squeal/contact/solver.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr double negligible = 1e-7;         // of the largest entry: what the sweeps leave to the product with W
constexpr std::size_t fits_the_cache = 250; // rows: sweeping over W itself is as quick

void set_scales(ContactOperator& op)
{
  const std::size_t n = op.size(), block = op.block();
  double largest = 0;
  for (std::size_t i = 0; i < n; ++i) largest = std::max(largest, op.W[i * n + i]);
  for (std::size_t i = 0; i < n; i += block)
  {
    PairBlock& A = op.diagonal.emplace_back();
    A = {};
    for (std::size_t k = 0; k < block; ++k)
      for (std::size_t l = 0; l < block; ++l) A[k][l] = op.W[(i + k) * n + i + l];
    // a pair that cannot move takes the scale of the others, so that a gap it cannot close is not passed over
    const double normal = A[0][0] > 0 ? A[0][0] : largest, tangential = std::max(A[1][1], A[2][2]);
    op.rho_n.push_back(normal > 0 ? 1 / normal : 1);
    op.rho_t.push_back(tangential > 0 ? 1 / tangential : op.rho_n.back());
  }
}

/// Whether the block of pairs i and j (row offsets) has an entry above `limit`.
bool matters(const ContactOperator& op, std::size_t i, std::size_t j, double limit)
{
  const std::size_t n = op.size(), block = op.block();
  for (std::size_t k = 0; k < block; ++k)
    for (std::size_t l = 0; l < block; ++l)
      if (std::abs(op.W[(i + k) * n + j + l]) > limit) return true;
  return false;
}

NearField near_field(const ContactOperator& op)
{
  NearField near;
  const std::size_t n = op.size(), block = op.block();
  double largest = 0;
  for (std::size_t i = 0; i < n; ++i) largest = std::max(largest, op.W[i * n + i]);
  for (std::size_t i = 0; i < n; i += block)
  {
    near.runs_of.push_back(near.runs.size());
    near.values_of.push_back(near.values.size());
    for (std::size_t j = 0; j < n; j += block)
    {
      if (!matters(op, i, j, negligible * largest)) continue;
      const bool follows =
          near.runs.size() > near.runs_of.back() && near.runs.back().first + near.runs.back().count == j;
      if (!follows) near.runs.push_back({j, 0});
      near.runs.back().count += block;
    }
    for (std::size_t run = near.runs_of.back(); run < near.runs.size(); ++run)
      for (std::size_t k = 0; k < block; ++k)
      {
        const double* row = &op.W[(i + k) * n + near.runs[run].first];
        for (std::size_t j = 0; j < near.runs[run].count; ++j) near.values.push_back(static_cast<float>(row[j]));
      }
  }
  near.runs_of.push_back(near.runs.size());
  return near;
}

} // namespace

ContactOperator make_contact_operator(std::vector<double> W, int pairs, int directions)
{
  ContactOperator op;
  op.pairs = pairs;
  op.directions = directions;
  op.W = std::move(W);
  const std::size_t n = op.size();
  if (op.W.size() != n * n)
    throw Error("contact: " + std::to_string(pairs) + " pairs of " + std::to_string(op.block()) + " rows need " +
                std::to_string(n * n) + " entries of W, not " + std::to_string(op.W.size()));
  set_scales(op);
  if (n > fits_the_cache) op.near = near_field(op);
  return op;
}

} // namespace squeal
