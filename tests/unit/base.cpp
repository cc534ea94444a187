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
  CHECK_THROWS_AS(check(VecSetSizes(x, 3, 2)), Error); // more local entries than there are in all
}

TEST_CASE("the nearest word is the misspelt one, and a far word has none")
{
  const std::vector<std::string> known = {"friction", "transient", "cycle"};
  CHECK(nearest_word("fricton", known) == "friction");
  CHECK(nearest_word("zzzzzzzzzz", known).empty());
}
