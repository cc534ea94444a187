// ranks: 1 2 3
#include "squeal/base/petsc.hpp"

#include <doctest/doctest.h>
#include <string>
#include <vector>

using namespace squeal;

TEST_CASE("a problem on one rank is thrown with its text on every rank")
{
  const int last = ranks_of(PETSC_COMM_WORLD) - 1;
  const std::string mine = rank_of(PETSC_COMM_WORLD) == last ? "disk full" : "";
  CHECK_THROWS_WITH_AS(agree(PETSC_COMM_WORLD, mine), "disk full", Error);
  CHECK_NOTHROW(agree(PETSC_COMM_WORLD, ""));
}

TEST_CASE("a failed library call throws PETSc's own text")
{
  Owned<Vec> x;
  check(VecCreate(PETSC_COMM_WORLD, x.put()));
  CHECK_THROWS_AS(check(VecSetSizes(x, 3, 2)), LibraryError); // more local entries than there are in all
}

TEST_CASE("an exception in a callback comes out of the library call that led there")
{
  const auto multiply = [](Mat A, Vec, Vec) -> PetscErrorCode
  {
    std::exception_ptr* failure = nullptr;
    PetscCall(MatShellGetContext(A, &failure));
    return guarded(*failure, [] { throw Error("no such motion"); });
  };
  std::exception_ptr failure;
  Owned<Mat> A;
  Owned<Vec> x, y;
  check(MatCreateShell(PETSC_COMM_WORLD, 1, 1, PETSC_DETERMINE, PETSC_DETERMINE, &failure, A.put()));
  check(MatShellSetOperation(A, MATOP_MULT, reinterpret_cast<void (*)(void)>(+multiply)));
  check(MatCreateVecs(A, x.put(), y.put()));
  CHECK_THROWS_WITH_AS(check_after_callbacks(MatMult(A, x, y), failure), "no such motion", Error);
  CHECK_NOTHROW(check_after_callbacks(PETSC_SUCCESS, {}));
}

TEST_CASE("the nearest word is the misspelt one, and a far word has none")
{
  const std::vector<std::string> known = {"friction", "transient", "cycle"};
  CHECK(nearest_word("fricton", known) == "friction");
  CHECK(nearest_word("zzzzzzzzzz", known).empty());
}

TEST_CASE("what is set whole comes back whole, and the rows visited are those that were put in")
{
  const PetscInt size = 7;
  Owned<Mat> A;
  check(MatCreateAIJ(PETSC_COMM_WORLD, PETSC_DECIDE, PETSC_DECIDE, size, size, 2, nullptr, 2, nullptr, A.put()));
  Owned<Vec> x;
  check(MatCreateVecs(A, x.put(), nullptr));
  std::vector<double> entries;
  for (int i = 0; i < size; ++i) entries.push_back(i * i - 3);
  set_all_entries(x, entries);
  CHECK(all_entries(x) == entries);
  CHECK(row_layout(x).total() == size);
  CHECK(row_layout(A).counts == row_layout(x).counts);

  PetscInt first = 0, last = 0;
  check(MatGetOwnershipRange(A, &first, &last));
  for (PetscInt i = first; i < last; ++i)
    for (const PetscInt j : {i, (i + 3) % size}) check(MatSetValue(A, i, j, 10. * i + j, INSERT_VALUES));
  check(MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY));
  PetscInt rows = 0;
  for_each_row(A,
               [&](PetscInt i, std::span<const PetscInt> columns, std::span<const PetscScalar> values)
               {
                 CHECK(i == first + rows++);
                 CHECK(columns.size() == 2);
                 for (std::size_t k = 0; k < columns.size(); ++k) CHECK(values[k] == 10. * i + columns[k]);
               });
  CHECK(rows == last - first);
  CHECK(comm_of(A) == comm_of(x));
}

TEST_CASE("a message is as long as it must be")
{
  CHECK(format("%s at %.4g", "load", 1234.56) == "load at 1235");
  CHECK(format("%s", std::string(2000, 'x').c_str()).size() == 2000);
}
