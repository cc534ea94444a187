#define DOCTEST_CONFIG_IMPLEMENT
#include "squeal/base/petsc.hpp"

#include <doctest/doctest.h>

int main(int argc, char** argv)
{
  squeal::Session session(argc, argv, nullptr);
  doctest::Context context(argc, argv);
  const int failed = context.run();
  int failed_anywhere = failed;
  MPI_Allreduce(&failed, &failed_anywhere, 1, MPI_INT, MPI_MAX, PETSC_COMM_WORLD);
  return failed_anywhere;
}
