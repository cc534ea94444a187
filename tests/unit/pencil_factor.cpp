// ranks: 1 2 3
// The factor of K - shift M by either way of several ranks, where every rank makes it whole and where they share it:
// residuals of a matrix whose condition is below 1e4 are below 1e-11 of the right-hand side.
#include "../support/option.hpp"
#include "../support/small_models.hpp"
#include "../support/temporary_folder.hpp"
#include "squeal/algebra/shift_invert.hpp"
#include "squeal/base/checkpoint.hpp"

#include <doctest/doctest.h>
#include <filesystem>
#include <utility>

using namespace squeal;

namespace
{

/// A chain.
Owned<Mat> stiffness(std::size_t size)
{
  test::Rows K = test::zeros(size, size);
  for (std::size_t i = 0; i < size; ++i)
  {
    K[i][i] = 2.1 + 0.01 * static_cast<double>(i);
    if (i + 1 < size) K[i][i + 1] = K[i + 1][i] = -1;
  }
  return test::sparse(K, K);
}

/// With entries where K has none.
Owned<Mat> mass(std::size_t size)
{
  test::Rows M = test::zeros(size, size);
  for (std::size_t i = 0; i < size; ++i)
  {
    M[i][i] = 1 + 0.1 * static_cast<double>(i % 3);
    if (i + 2 < size) M[i][i + 2] = M[i + 2][i] = 0.1;
  }
  return test::sparse(M, M);
}

double residual(Mat K, Mat M, double shift, const MultiVector& X, const MultiVector& B)
{
  MultiVector R = product(K, X);
  R.entries -= shift * product(M, X).entries + B.entries;
  return column_norms(R).maxCoeff() / column_norms(B).minCoeff();
}

} // namespace

TEST_CASE("solutions and counts do not depend on how the ranks make the factor")
{
  for (const auto& [size, whole_limit] : {std::pair<std::size_t, double>{37, 0}, {37, 1}, {2, 0}, {2, 1}})
  {
    const PencilOptions options{.whole_limit = whole_limit}; // shared by the ranks, of which some have no rows; whole
    const Owned<Mat> M = mass(size), K = stiffness(size);
    PencilFactor counting(K, M, Keep::factor, options), discarding(K, M, Keep::count, options);
    for (const double shift : {-1., 2.6})
    {
      REQUIRE(counting.factorise(shift));
      REQUIRE(discarding.factorise(shift));
      for (const PetscInt columns : {1, 2, 7})
      {
        const MultiVector B = random_multivector(K, columns);
        CHECK(residual(K, M, shift, counting.solve(B), B) < 1e-11);
      }
      int below = counting.negative_pivots();
      CHECK((shift < 0 ? below == 0 : below > 0));
      CHECK(discarding.negative_pivots() == below);
      MPI_Bcast(&below, 1, MPI_INT, 0, PETSC_COMM_WORLD);
      CHECK(below == counting.negative_pivots()); // on all ranks
    }
  }
}

TEST_CASE("a factor in files solves as one in memory, and takes the files with it")
{
  const test::TemporaryFolder place;
  const std::filesystem::path folder = place.path / "checkpoints";
  const test::Option in_files("-modes_mat_mumps_icntl_22", "1");
  open_checkpoints({folder, "", false});
  const Owned<Mat> M = mass(37), K = stiffness(37);
  for (const double whole_limit : {0., 1.})
    for (const Keep keep : {Keep::factor, Keep::lu})
    {
      {
        PencilFactor factor(K, M, keep, {.whole_limit = whole_limit});
        REQUIRE(factor.factorise(2.6));
        MPI_Barrier(PETSC_COMM_WORLD);
        CHECK_FALSE(std::filesystem::is_empty(folder));
        const MultiVector B = random_multivector(K, 7);
        CHECK(residual(K, M, 2.6, factor.solve(B), B) < 1e-11);
        MPI_Barrier(PETSC_COMM_WORLD);
      }
      MPI_Barrier(PETSC_COMM_WORLD);
      CHECK(std::filesystem::is_empty(folder));
      MPI_Barrier(PETSC_COMM_WORLD);
    }
  open_checkpoints({});
}
