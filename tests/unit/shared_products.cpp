// ranks: 1 2 3 4
// Products with W of columns that ranks share, against the product on rank 0 alone: rounding of sums of 1203 numbers of
// size 1, 1e-11.
#include "squeal/contact/contact_operator.hpp"

#include <algorithm>
#include <cmath>
#include <doctest/doctest.h>

using namespace squeal;

namespace
{

std::vector<double> symmetric_matrix(std::size_t size)
{
  std::vector<double> W(size * size);
  for (std::size_t i = 0; i < size; ++i)
    for (std::size_t j = 0; j < size; ++j)
      W[i * size + j] = std::cos(static_cast<double>(i * j % 101)) + (i == j ? 30. : 0.);
  return W;
}

std::vector<double> product(const ContactOperator& W, const std::vector<double>& x)
{
  std::vector<double> y(x.size());
  const std::span<const double> in = x;
  const std::span<double> out = y;
  W.multiply(std::span(&in, 1), std::span(&out, 1));
  return y;
}

} // namespace

TEST_CASE("ranks form products together, again and again, and what they do in between is their own")
{
  const MPI_Comm comm = PETSC_COMM_WORLD;
  for (const int pairs : {7, 401}) // too small to share, and no whole number of strips
  {
    const std::size_t size = 3 * static_cast<std::size_t>(pairs);
    const bool first = rank_of(comm) == 0;
    ContactOperator W, alone;
    if (first) W = alone = make_contact_operator(symmetric_matrix(size), pairs, 2);
    W.share_columns(comm);
    for (int round = 0; round < 3; ++round)
    {
      const ServedProducts served(W);
      for (int k = 0; first && k <= round; ++k)
      {
        std::vector<double> x(size);
        for (std::size_t i = 0; i < size; ++i) x[i] = std::sin(static_cast<double>(i) + k);
        const std::vector<double> together = product(W, x), exact = product(alone, x);
        for (std::size_t i = 0; i < size; ++i) CHECK(std::abs(together[i] - exact[i]) < 1e-11);
      }
    }
    double sum = 1;
    MPI_Allreduce(MPI_IN_PLACE, &sum, 1, MPI_DOUBLE, MPI_SUM, comm); // ranks have left the service
    CHECK(sum == ranks_of(comm));
  }
}
