#include "reduced_flow.hpp"
#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/run_control.hpp"

#include <algorithm>
#include <Eigen/LU>
#include <Eigen/QR>
#include <limits>
#include <utility>

namespace squeal
{

namespace
{

/// (q, v) in one vector.
VectorXd stacked(const ReducedState& state)
{
  VectorXd both(state.q.size() + state.v.size());
  both << state.q, state.v;
  return both;
}

} // namespace

VectorXd ReducedCoordinates::of(Vec motion) const
{
  return stacked(coordinates(model, structure, displacement(motion), velocity(motion)));
}

void ReducedCoordinates::add(const VectorXd& coordinates, Vec motion) const
{
  const Eigen::Index n = model.size();
  add_motion(model, {coordinates.head(n), coordinates.tail(n)}, displacement(motion), velocity(motion));
}

std::vector<Owned<Vec>> motions_of(const ReducedCoordinates& coordinates, const MatrixXd& columns, Vec pattern)
{
  std::vector<Owned<Vec>> motions;
  for (const auto column : columns.colwise())
  {
    motions.push_back(zeros_like(pattern));
    coordinates.add(column, motions.back());
  }
  return motions;
}

Flow flow_of(ReducedMap& map, const Structure& structure)
{
  const auto period_map = [&](double period, Vec start, Vec end, Vec rate)
  {
    end_if_asked(map.comm);
    const PeriodEnd period_end =
        end_of_period(map, period, coordinates(map.model, structure, displacement(start), velocity(start)));
    for (const auto& [state, motion] : {std::pair{&period_end.end, end}, {&period_end.rate, rate}})
    {
      if (!motion) continue;
      check(VecSet(motion, 0));
      add_motion(map.model, *state, displacement(motion), velocity(motion));
    }
  };
  return {period_map, structure.M, structure.K};
}

MonodromyCorrection monodromy_correction(ReducedMap& map, double period, const ReducedState& state)
{
  const ReducedState flow = end_of_period(map, period, state).rate;
  return monodromy_correction(map.model, monodromy(map, period, record_contacts(map, period, state)), flow);
}

MonodromyCorrection monodromy_correction(const ReducedModel& model, const MatrixXd& columns, const ReducedState& f)
{
  const Eigen::Index n = model.size(), slow = model.slow;
  const VectorXd flow = stacked(f), image = stacked({model.K_z * f.q, model.M_z * f.v});
  // dPhi S S' - f f^+ = U V', and (U V' - I)^-1 + I = -U (I - V'U)^-1 V'
  MatrixXd U(2 * n, 2 * slow + 1), V = MatrixXd::Zero(2 * slow + 1, 2 * n);
  U << columns, -flow;
  V.topLeftCorner(slow, slow).diagonal().setOnes();
  V.block(slow, n, slow, slow).diagonal().setOnes();
  V.bottomRows(1) = image.transpose() / flow.dot(image);
  return {-U, solve_dense(MatrixXd::Identity(V.rows(), V.rows()) - V * U, V,
                          "reduced model: the period map has a second multiplier 1")};
}

Preconditioner preconditioner_of(const MonodromyCorrection& correction, const ReducedCoordinates& coordinates)
{
  return [&correction, coordinates](double, Vec x, Vec y)
  {
    const VectorXd seen = coordinates.of(x);
    check(VecAXPBY(y, -1, 0, x));
    coordinates.add(correction.left * (correction.right * seen), y);
  };
}

namespace
{

/// Which multipliers are wanted.
struct LargeValues
{
  double above = 0; // in modulus
  int at_least = 0, at_most = 0;
};

/// How many of the values are wanted, complex pairs whole.
std::size_t number_of(const std::vector<Complex>& values, const LargeValues& wanted)
{
  std::size_t count = 0;
  while (count < values.size() &&
         (std::abs(values[count]) > wanted.above || count < static_cast<std::size_t>(wanted.at_least)))
  {
    const std::size_t next = count + (values[count].imag() == 0 ? 1 : 2);
    if (next > static_cast<std::size_t>(wanted.at_most)) break;
    count = next;
  }
  return count;
}

/// Gives every rank the values that rank 0 has.
void broadcast_values(std::vector<Complex>& values, MPI_Comm comm)
{
  MatrixXd parts(2, static_cast<Index>(values.size()));
  for (Index i = 0; i < parts.cols(); ++i)
    parts.col(i) << values[static_cast<std::size_t>(i)].real(), values[static_cast<std::size_t>(i)].imag();
  broadcast(parts, comm);
  values.clear();
  for (Index i = 0; i < parts.cols(); ++i) values.emplace_back(parts(0, i), parts(1, i));
}

/// Coordinates of the slow shapes for all of them, and back.
template <class Matrix> Matrix slow_rows(const Matrix& X, Index size, Index slow)
{
  Matrix result(2 * slow, X.cols());
  result << X.topRows(slow), X.middleRows(size, slow);
  return result;
}

MatrixXd with_fast_rows(const MatrixXd& X, Index size, Index slow)
{
  MatrixXd result = MatrixXd::Zero(2 * size, X.cols());
  result.topRows(slow) = X.topRows(slow);
  result.middleRows(size, slow) = X.bottomRows(slow);
  return result;
}

/// (Phi - m)^-1 x + x/m. With C the columns and S the slow coordinates Phi = C S':
///     (Phi - m)^-1 = -1/m + C (S'C - m)^-1 S'/m
Eigen::VectorXcd resolvent(const MatrixXd& columns, Complex m, const Eigen::VectorXcd& x)
{
  const Index size = columns.rows() / 2, slow = columns.cols() / 2;
  Eigen::MatrixXcd square = slow_rows(columns, size, slow).cast<Complex>();
  square.diagonal().array() -= m;
  const Eigen::VectorXcd z = square.partialPivLu().solve(slow_rows<Eigen::MatrixXcd>(x, size, slow));
  return columns.cast<Complex>() * z / m;
}

/// x = (Phi - m)^-1 x: -1/m on what the coordinates miss.
void apply_resolvent(const MatrixXd& columns, const ReducedCoordinates& coordinates, Complex m, Vec real, Vec imaginary)
{
  Eigen::VectorXcd x(columns.rows());
  x.real() = coordinates.of(real);
  x.imag() = coordinates.of(imaginary);
  const Eigen::VectorXcd y = resolvent(columns, m, x);
  const Complex factor = -1. / m; // of x itself
  const Owned<Vec> old = copy_of(real);
  check(VecAXPBY(real, -factor.imag(), factor.real(), imaginary));
  check(VecAXPBY(imaginary, factor.imag(), factor.real(), old));
  coordinates.add(y.real(), real);
  coordinates.add(y.imag(), imaginary);
}

/// Columns (q, v) that act on a state by the energy product as these left vectors do by the plain one.
MatrixXd energy_representatives(const ReducedModel& model, const MatrixXd& left)
{
  const Index n = model.size();
  MatrixXd result(left.rows(), left.cols());
  result << solve_dense(model.K_z, left.topRows(n), "cycle: the reduced model has a motion without stiffness"),
      model.M_factor.solve(left.bottomRows(n));
  return result;
}

} // namespace

ReducedSpectrum large_multipliers(ReducedMap& map, double period, std::span<const StepRecord> contacts)
{
  constexpr LargeValues wanted{0.85, 4, 24};
  const Index size = map.model.size(), slow = map.model.slow;
  const MatrixXd columns = monodromy(map, period, contacts);
  constexpr LargeValues known{0.5, 0, std::numeric_limits<int>::max()};
  ReducedSpectrum result;
  MatrixXd right, left;
  on_rank_zero(map.comm,
               [&]
               {
                 const MatrixXd square = slow_rows(columns, size, slow);
                 const std::vector<DenseEigenpair> pairs = solve_dense_unsymmetric(square),
                                                   adjoint = solve_dense_unsymmetric(square.transpose());
                 result.known = values_of(pairs);
                 const std::size_t count = std::max(number_of(result.known, wanted), number_of(result.known, known));
                 result.known.resize(count);
                 right = real_columns(pairs, square.rows()).leftCols(static_cast<Index>(count));
                 const MatrixXd left_columns = real_columns(adjoint, square.rows());
                 left.resize(right.rows(), right.cols());
                 const std::vector<std::size_t> places = nearest_places(result.known, values_of(adjoint));
                 for (std::size_t i = 0; i < count; ++i)
                   left.col(static_cast<Index>(i)) = left_columns.col(static_cast<Index>(places[i]));
               });
  broadcast_values(result.known, map.comm);
  broadcast(right, map.comm);
  broadcast(left, map.comm);
  result.known_right = orthonormal_columns(columns * right);
  result.known_left = orthonormal_columns(left);
  result.values = result.known;
  result.values.resize(number_of(result.known, wanted));
  const auto count = static_cast<Index>(result.values.size()); // leading columns span the vectors of leading values
  // what the slow coordinates miss of both comes with one more passage
  result.right = result.known_right.leftCols(count);
  result.left =
      orthonormal_columns(apply_adjoint(map, period, contacts, with_fast_rows(left.leftCols(count), size, slow)));
  result.columns = columns;
  return result;
}

SlowMotions slow_motions_of(const ReducedSpectrum& spectrum, const ReducedModel& model,
                            const ReducedCoordinates& coordinates, Vec pattern)
{
  SlowMotions slow;
  slow.values = spectrum.values;
  slow.next = slow.values.size() < spectrum.known.size() ? std::abs(spectrum.known[slow.values.size()]) : 0;
  slow.errors.assign(slow.values.size(), 0);
  slow.rises = slow.errors;
  slow.right = motions_of(coordinates, spectrum.right, pattern);
  slow.left = motions_of(coordinates, energy_representatives(model, spectrum.left), pattern);
  slow.correct = [coordinates, columns = spectrum.columns](Complex m, Vec real, Vec imaginary)
  { apply_resolvent(columns, coordinates, m, real, imaginary); };
  return slow;
}

std::function<void(Vec)> taking_out_known(const ReducedSpectrum& spectrum, const ReducedCoordinates& coordinates)
{
  const Index slow = spectrum.columns.cols() / 2, size = spectrum.columns.rows() / 2;
  const Eigen::PartialPivLU<MatrixXd> gram(spectrum.known_left.transpose() *
                                           slow_rows(spectrum.known_right, size, slow));
  return [coordinates, size, slow, gram, right = spectrum.known_right, left = spectrum.known_left](Vec motion)
  {
    const MatrixXd x = slow_rows<MatrixXd>(coordinates.of(motion), size, slow);
    coordinates.add(-right * gram.solve(left.transpose() * x), motion);
  };
}

void add_changes(const std::vector<Complex>& others, double part, SlowMotions& slow)
{
  for (std::size_t i = 0; i < slow.values.size(); ++i)
  {
    const double change = std::abs(others[i]) - std::abs(slow.values[i]);
    slow.errors[i] += part * std::abs(change);
    slow.rises[i] += part * std::max(0., change);
  }
}

std::vector<Complex> multipliers_along(const ReducedSpectrum& spectrum, ReducedMap& map, double period,
                                       std::span<const StepRecord> contacts)
{
  const MatrixXd image = apply_tangent(map, period, contacts, spectrum.right);
  std::vector<Complex> values;
  on_rank_zero(map.comm,
               [&]
               {
                 const Eigen::ColPivHouseholderQR<MatrixXd> gram(spectrum.left.transpose() * spectrum.right);
                 const std::vector<Complex> found =
                     values_of(solve_dense_unsymmetric(gram.solve(spectrum.left.transpose() * image)));
                 for (const std::size_t place : nearest_places(spectrum.values, found)) values.push_back(found[place]);
               });
  broadcast_values(values, map.comm);
  return values;
}

} // namespace squeal
