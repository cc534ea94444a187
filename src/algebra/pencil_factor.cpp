#include "squeal/algebra/pencil_factor.hpp"

#include "mumps.hpp"
#include "squeal/base/integers.hpp"
#include "symbolic_factor.hpp"

namespace squeal
{

struct PencilFactor::Parts
{
  MPI_Comm comm = MPI_COMM_NULL;
  RowLayout layout;
  Triplets entries; // those of K, then those of M; MUMPS adds up entries of the same place
  std::size_t first_of_M = 0;
  std::vector<double> values; // K - shift M
  Eigen::MatrixXd right;      // on rank 0
  Mumps mumps;
};

namespace
{

/// The position of each degree of freedom in nested dissection, counted from one as MUMPS does; on rank 0.
std::vector<MUMPS_INT> elimination_order(Mat K, int dofs)
{
  const Triplets pattern = gather(lower_triangle(K), TripletContent::pattern, comm_of(K));
  std::vector<MUMPS_INT> order;
  on_rank_zero(comm_of(K),
               [&]
               {
                 for (const int position : analyse(pattern, dofs, 0).position) order.push_back(position + 1);
               });
  return order;
}

} // namespace

PencilFactor::PencilFactor(Mat K, Mat M, Symmetry symmetry, const PencilOptions& options)
    : parts_(std::make_unique<Parts>())
{
  Parts& parts = *parts_;
  parts.comm = comm_of(K);
  parts.layout = row_layout(K);
  const auto append = [&](Mat A)
  { symmetry == Symmetry::none ? append_rows(A, 0, parts.entries) : append_lower_triangle(A, parts.entries); };
  append(K);
  parts.first_of_M = parts.entries.value.size();
  append(M);
  parts.values.resize(parts.entries.value.size());
  std::vector<MUMPS_INT> order = elimination_order(K, parts.layout.total());
  parts.mumps = start_mumps(parts.comm, symmetry == Symmetry::none ? MumpsSymmetry::none : MumpsSymmetry::symmetric);
  set_entries(parts.mumps, parts.entries, parts.layout.total());
  DMUMPS_STRUC_C& mumps = *parts.mumps;
  control(mumps, 14) = to_int(options.room);
  mumps.a_loc = parts.values.data();
  mumps.perm_in = order.data();
  run(mumps, MumpsJob::analyse);
  mumps.perm_in = nullptr;
}

PencilFactor::~PencilFactor() = default;

bool PencilFactor::factorise(double shift)
{
  Parts& parts = *parts_;
  for (std::size_t k = 0; k < parts.values.size(); ++k)
    parts.values[k] = (k < parts.first_of_M ? 1 : -shift) * parts.entries.value[k];
  return squeal::factorise(*parts.mumps);
}

int PencilFactor::negative_pivots() const
{
  return number_of_negative_pivots(*parts_->mumps);
}

MultiVector PencilFactor::solve(const MultiVector& X) const
{
  Parts& parts = *parts_;
  MultiVector Y = X;
  const bool here = rank_of(parts.comm) == 0;
  const int rows = to_int(X.entries.rows()), columns = to_int(X.columns());
  if (columns == 0) return Y;
  if (here) parts.right.resize(parts.layout.total(), columns);
  const auto whole = [&](int j) { return here ? parts.right.col(j).data() : nullptr; };
  for (int j = 0; j < columns; ++j)
    MPI_Gatherv(X.entries.col(j).data(), rows, MPI_DOUBLE, whole(j), parts.layout.counts.data(),
                parts.layout.starts.data(), MPI_DOUBLE, 0, parts.comm);
  DMUMPS_STRUC_C& mumps = *parts.mumps;
  control(mumps, 27) = columns; // all of them at each reading of the factor
  mumps.rhs = parts.right.data();
  mumps.nrhs = columns;
  mumps.lrhs = parts.layout.total();
  run(mumps, MumpsJob::solve);
  for (int j = 0; j < columns; ++j)
    MPI_Scatterv(whole(j), parts.layout.counts.data(), parts.layout.starts.data(), MPI_DOUBLE, Y.entries.col(j).data(),
                 rows, MPI_DOUBLE, 0, parts.comm);
  return Y;
}

OptionList options_of(PencilOptions& options)
{
  return {
      {"-modes_factor_room", &options.room, Range::any,
       "[%] of memory beyond what MUMPS estimates for a factor; it grows by itself"},
  };
}

} // namespace squeal
