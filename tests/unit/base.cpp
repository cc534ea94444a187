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
  Owned<PetscViewer> viewer;
  CHECK_THROWS_AS(check(PetscViewerBinaryOpen(PETSC_COMM_WORLD, "/no/such/file", FILE_MODE_READ, viewer.put())), Error);
}

TEST_CASE("the nearest word is the misspelt one, and a far word has none")
{
  const std::vector<std::string> known = {"friction", "transient", "cycle"};
  CHECK(nearest_word("fricton", known) == "friction");
  CHECK(nearest_word("zzzzzzzzzz", known).empty());
}
