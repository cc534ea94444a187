#include "reduction_basis.hpp"

#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/broadcast.hpp"
#include "squeal/base/constants.hpp"
#include "squeal/base/error.hpp"
#include "squeal/reduction/sliding_basis.hpp"
#include "squeal/solid/structure.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace squeal
{

namespace
{

/// A column of the modes.
struct ModeShape
{
  double frequency = 0; // [rad/s]
  Vec shape = nullptr;
};

/// The shapes of the real modes above all complex ones.
std::vector<ModeShape> shapes_above(const RealModes* real, const std::vector<ComplexMode>& modes)
{
  std::vector<ModeShape> shapes;
  const double highest = two_pi * highest_frequency(modes);
  for (std::size_t i = 0; real && i < real->shapes.size(); ++i)
    if (real->omega[i] > highest) shapes.push_back({real->omega[i], real->shapes[i]});
  return shapes;
}

/// T of X T orthonormal in the product in which E is the Gram matrix of X, as far as it goes.
struct Orthonormal
{
  const MatrixXd& E;
  MatrixXd T;
  Index seen = 0;      // columns of X
  double smallest = 1; // part of a direction that was new when it came, squared: rounding is larger by its inverse
};

/// The outcome of extending a basis by columns.
struct Extension
{
  Index taken = 0, left_out = 0; // directions; left out: by the cap alone
  double lost = 0;               // part of the columns' energy, on average, that the cap left out
};

/// Takes in what the next `count` columns of X hold that is new. Directions of which less than `threshold` of the
/// columns' own size is new are dropped, and of the others all but the `at_most` largest.
Extension extend(Orthonormal& basis, Index count, double threshold, Index at_most = std::numeric_limits<Index>::max())
{
  if (count == 0) return {};
  const MatrixXd& E = basis.E;
  MatrixXd columns = MatrixXd::Zero(E.rows(), count), image;
  for (Index j = 0; j < count; ++j)
    columns(basis.seen + j, j) = 1 / std::sqrt(std::max(E(basis.seen + j, basis.seen + j), 1e-300));
  for (int pass = 0; pass < 2; ++pass)
  {
    image.noalias() = E * columns;
    columns -= basis.T * (basis.T.transpose() * image);
  }
  image.noalias() = E * columns;
  const MatrixXd fresh = columns.transpose() * image;
  const auto [sizes, directions] = solve_dense_symmetric((fresh + fresh.transpose()) / 2);
  // A part that is negative, or below the rounding of earlier directions, is nothing new. That bound is far too wide
  // where such a direction came with hardly anything.
  constexpr double widest = 1e-9;
  const double of_sums = static_cast<double>(E.rows()) * std::numeric_limits<double>::epsilon();
  const double rounding = std::max(-sizes.minCoeff(), std::min(of_sums / basis.smallest, widest));
  const Index fresh_ones = (sizes.array() > std::max(threshold * threshold, rounding)).count();
  const Index kept = std::min(fresh_ones, at_most), left_out = fresh_ones - kept;
  if (kept > 0) basis.smallest = std::min(basis.smallest, sizes(sizes.size() - kept));
  basis.T.conservativeResize(Eigen::NoChange, basis.T.cols() + kept);
  basis.T.rightCols(kept) =
      columns * (directions.rightCols(kept) * sizes.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal());
  basis.seen += count;
  return {kept, left_out, sizes.segment(sizes.size() - fresh_ones, left_out).sum() / static_cast<double>(count)};
}

/// Solves for combinations of the attachments and shows them to `visit`, some at a time, in the coordinates that Z
/// keeps.
template <class Visit> void solve_attachments(const Attachments& attachments, const MatrixXd& combinations, Visit visit)
{
  const Owned<Vec> pattern = vector_of_columns(attachments.P), on_rows = vector_of_rows(attachments.P);
  constexpr Index at_once = 64;
  for (Index first = 0; first < combinations.cols(); first += at_once)
  {
    std::vector<Owned<Vec>> force, shape;
    for (const auto column : combinations.middleCols(first, std::min(at_once, combinations.cols() - first)).colwise())
    {
      set_all_entries(on_rows, {column.data(), static_cast<std::size_t>(column.size())});
      force.push_back(zeros_like(pattern));
      shape.push_back(zeros_like(pattern));
      check(MatMultTranspose(attachments.P, on_rows, force.back()));
    }
    const std::vector<double> no_forces(attachments.factor.forward(std::vector<Vec>(force.begin(), force.end())).size(),
                                        0.);
    attachments.factor.backward(no_forces, std::vector<Vec>(shape.begin(), shape.end()));
    visit(first, columns_of(std::vector<Vec>(shape.begin(), shape.end())));
  }
}

/// X'E X of modes and attachments X = [modes, E^-1 P'], from that of the modes and P X of the modes.
MatrixXd energies(const Attachments& attachments, const MatrixXd& energy_of_modes, const MatrixXd& of_modes)
{
  const Index modes = of_modes.cols(), count = of_modes.rows();
  std::vector<double> condensed = attachments.factor.condensed(1);
  broadcast(condensed, comm_of(attachments.P));
  MatrixXd result(modes + count, modes + count);
  result << energy_of_modes, of_modes.transpose(), of_modes, MatrixXd::Map(condensed.data(), count, count);
  return result;
}

/// Orthonormal combinations of shapes that are orthonormal in the energy, by falling period: u'M u against the energy.
/// `mass`: of the shapes. Sets `slow` to the number of those that swing by less than four times omega [rad/s].
MatrixXd by_falling_period(const MatrixXd& mass, double omega, Index& slow)
{
  const SymmetricEigenpairs spectrum = solve_dense_symmetric((mass + mass.transpose()) / 2);
  constexpr double fastest = 4; // times omega
  slow = (spectrum.lambda.array() * (1 + fastest * fastest) * omega * omega > 1).count();
  return spectrum.y.rowwise().reverse();
}

} // namespace

double highest_frequency(const std::vector<ComplexMode>& modes)
{
  double highest = 0;
  for (const ComplexMode& mode : modes) highest = std::max(highest, mode.frequency_hz());
  return highest;
}

MultiVector mode_columns(const std::vector<ComplexMode>& modes, const Reduction& reduction,
                         const ClosedContact& contact)
{
  const double omega = modes.front().lambda.imag();
  std::vector<const ComplexMode*> taken;
  for (const ComplexMode& mode : modes) taken.push_back(&mode);
  std::sort(taken.begin() + 1, taken.end(),
            [&](const ComplexMode* a, const ComplexMode* b)
            { return std::abs(a->lambda.imag() - omega) < std::abs(b->lambda.imag() - omega); });
  taken.resize(std::min(taken.size(), static_cast<std::size_t>(reduction.modes)));
  std::vector<ModeShape> shapes;
  for (const ComplexMode* mode : taken)
    for (const Vec part : {mode->real.get(), mode->imaginary.get()})
      shapes.push_back({std::abs(mode->lambda.imag()), part});
  for (const ModeShape& shape : shapes_above(reduction.real, modes)) shapes.push_back(shape);
  std::vector<Vec> columns;
  for (const ModeShape& shape : shapes) columns.push_back(shape.shape);
  return product(contact.Z, kept_rows(columns_of(columns), contact));
}

Eigen::SparseMatrix<double> sliding_forces(const Interface& interface, const std::vector<int>& active)
{
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  const PairRows<Index> rows(interface.directions);
  const auto count = static_cast<Index>(active.size());
  Eigen::SparseMatrix<double> forces(count * rows.per_pair(), count);
  forces.reserve(Eigen::VectorXi::Constant(count, rows.per_pair()));
  for (Index i = 0; i < count; ++i)
  {
    const auto pair = static_cast<std::size_t>(active[static_cast<std::size_t>(i)]);
    forces.insert(rows.normal(i), i) = 1;
    for (int k = 0; k < interface.directions; ++k)
      forces.insert(rows.tangential(i) + k, i) = mu[pair] * e.of(pair)[static_cast<std::size_t>(k)];
  }
  return forces;
}

Owned<Mat> force_rows(const Eigen::SparseMatrix<double>& forces, Mat BZ)
{
  const IndexRange rows = own_rows(BZ);
  std::vector<SparseRow> own;
  for (Index force = 0; force < forces.cols(); ++force)
  {
    SparseRow row;
    for (Eigen::SparseMatrix<double>::InnerIterator entry(forces, force); entry; ++entry)
      row[to_int(entry.row())] = entry.value();
    if (const PetscInt place = row.begin()->first; rows.holds(place)) own.push_back(std::move(row));
  }
  const Owned<Mat> transposed = matrix_of_rows(own, rows.size(), comm_of(BZ));
  Owned<Mat> P;
  check(MatMatMult(transposed, BZ, MAT_INITIAL_MATRIX, PETSC_DEFAULT, P.put()));
  return P;
}

MultiVector make_basis(ReducedModel& model, const Attachments& attachments, const MultiVector& modes,
                       const MatrixXd& energy_of_modes, const MatrixXd& of_modes, Mat M, const AttachmentLimits& limits)
{
  const Index modal = modes.columns(), count = of_modes.rows();
  const MatrixXd energy = energies(attachments, energy_of_modes, of_modes);
  Orthonormal basis{energy, MatrixXd(energy.rows(), 0)};
  extend(basis, 2, 1e-7); // the followed mode is kept whatever else is
  extend(basis, modal - 2, 1e-6);
  const Index of_modes_alone = basis.T.cols();
  const Extension attached = extend(basis, count, limits.threshold, limits.at_most);
  if (attached.lost > limits.most_lost)
    throw Error(format("reduced model: half of the free memory holds %ld of %ld attachment shapes, and %.2g of the "
                       "pairs' own compliance would be lost: a larger machine takes more",
                       static_cast<long>(attached.taken), static_cast<long>(attached.taken + attached.left_out),
                       attached.lost));
  model.modes = static_cast<int>(of_modes_alone);
  model.attachments = static_cast<int>(attached.taken);
  model.left_out = static_cast<int>(attached.left_out);
  model.lost_compliance = attached.lost;
  if (attached.left_out > 0)
  {
    const VectorXd own = energy.diagonal().tail(count),
                   held = (basis.T.transpose() * energy.rightCols(count)).colwise().squaredNorm();
    constexpr double rounding = 1e-9; // of differences of energies; a pair that the shapes hold whole stays rigid
    model.of_left_out = ((own - held).array() > rounding * own.array()).select(own - held, 0);
  }

  // The basis is solved for, not combined from attachments: these would have to be held, those left out as well.
  const auto of_shapes = basis.T.topRows(modal);
  MultiVector X{modes.comm, MatrixXd(modes.entries.rows(), basis.T.cols())};
  X.entries.leftCols(of_modes_alone).noalias() = modes.entries * of_shapes.leftCols(of_modes_alone);
  solve_attachments(attachments, basis.T.bottomRightCorner(count, attached.taken),
                    [&](Index first, const MultiVector& shapes)
                    {
                      const Index at = of_modes_alone + first, some = shapes.columns();
                      X.entries.middleCols(at, some) = product(attachments.Z, shapes).entries;
                      X.entries.middleCols(at, some).noalias() += modes.entries * of_shapes.middleCols(at, some);
                    });
  const MatrixXd mass = symmetric_inner_products(X, M), turn = by_falling_period(mass, model.omega, model.slow);
  model.M_z = turn.transpose() * mass * turn;
  combine(X, turn);
  return X;
}

} // namespace squeal
