#pragma once
/// Masses with several pairs that all see each other.
#include "small_models.hpp"

#include <random>

namespace squeal::test
{

constexpr int pressed_pairs = 6;

/// Masses of two motions each on random springs to each other, all of them pressed onto a belt, pair i along motion
/// 2 i + 1 and rubbing along 2 i; three more hold nothing.
inline SmallModel pressed_masses()
{
  constexpr std::size_t pairs = pressed_pairs, n = 2 * pairs + 3;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> spring(0.1, 1);
  Rows K = zeros(n, n), B = zeros(2 * pairs, n);
  std::vector<double> load(n, 0);
  for (std::size_t i = 0; i < n; ++i)
  {
    K[i][i] += spring(random);
    for (std::size_t j = 0; j < i; ++j)
    {
      const double k = spring(random);
      K[i][i] += k;
      K[j][j] += k;
      K[i][j] = K[j][i] = -k;
    }
  }
  for (std::size_t i = 0; i < pairs; ++i)
  {
    B[2 * i][2 * i + 1] = B[2 * i + 1][2 * i] = 1;
    load[2 * i + 1] = -1;
  }
  SmallModel model;
  model.structure =
      make_structure(diagonal(std::vector<double>(n, 1)), diagonal(std::vector<double>(n, 0.01)), K, load);
  model.interface =
      make_interface(B, 1, std::vector<double>(pairs, 0), std::vector<double>(pairs, 1), 0.1, model.structure.K);
  return model;
}

} // namespace squeal::test
