#include "reduced_flow.hpp"

#include "squeal/algebra/dense_matrix.hpp"
#include "squeal/base/run_control.hpp"

namespace squeal
{

namespace
{

using Eigen::MatrixXd;
using Eigen::VectorXd;

Owned<Mat> matrix_of(const MatrixXd& values)
{
  Owned<Mat> result;
  const auto n = static_cast<PetscInt>(values.rows());
  check(MatCreateSeqDense(PETSC_COMM_SELF, n, n, nullptr, result.put()));
  double* entries = nullptr;
  check(MatDenseGetArrayWrite(result, &entries));
  std::copy_n(values.data(), values.size(), entries);
  check(MatDenseRestoreArrayWrite(result, &entries));
  return result;
}

void put(const VectorXd& values, Vec x)
{
  set_all_entries(x, {values.data(), static_cast<std::size_t>(values.size())});
}

void put(const ReducedState& state, Vec x)
{
  put(state.q, displacement(x));
  put(state.v, velocity(x));
}

Owned<Vec> vector_of(const VectorXd& values)
{
  Owned<Vec> x;
  check(VecCreateSeq(PETSC_COMM_SELF, static_cast<PetscInt>(values.size()), x.put()));
  put(values, x);
  return x;
}

VectorXd entries_of(Vec x)
{
  const std::vector<double> values = all_entries(x);
  return VectorXd::Map(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// (q, v) in one vector.
VectorXd stacked(const ReducedState& state)
{
  VectorXd both(state.q.size() + state.v.size());
  both << state.q, state.v;
  return both;
}

} // namespace

Owned<Vec> vector_of(const ReducedState& state)
{
  const Owned<Vec> q = vector_of(state.q), v = vector_of(state.v);
  return state_of(q, v);
}

ReducedState reduced_state(Vec state)
{
  return {entries_of(displacement(state)), entries_of(velocity(state))};
}

MatrixXd columns_of_states(std::span<const Vec> states)
{
  MatrixXd columns(0, 0);
  for (std::size_t k = 0; k < states.size(); ++k)
  {
    const VectorXd both = stacked(reduced_state(states[k]));
    if (k == 0) columns.resize(both.size(), static_cast<Eigen::Index>(states.size()));
    columns.col(static_cast<Eigen::Index>(k)) = both;
  }
  return columns;
}

void copy_columns(const MatrixXd& columns, std::span<const Vec> states)
{
  const Eigen::Index size = columns.rows() / 2;
  for (std::size_t k = 0; k < states.size(); ++k)
  {
    const auto column = columns.col(static_cast<Eigen::Index>(k));
    put(ReducedState{column.head(size), column.tail(size)}, states[k]);
  }
}

ReducedCoordinates own_coordinates()
{
  const auto of = [](Vec x) { return stacked(reduced_state(x)); };
  const auto add = [of](const VectorXd& more, Vec x)
  {
    const VectorXd sum = of(x) + more;
    put(ReducedState{sum.head(sum.size() / 2), sum.tail(sum.size() / 2)}, x);
  };
  return {of, add};
}

ReducedCoordinates coordinates_in(const ReducedModel& model, const Structure& structure)
{
  const auto of = [&](Vec x) { return stacked(coordinates(model, structure, displacement(x), velocity(x))); };
  const auto add = [&model](const VectorXd& both, Vec x)
  {
    add_motion(model, 1, both.head(model.size()), displacement(x));
    add_motion(model, 1, both.tail(model.size()), velocity(x));
  };
  return {of, add};
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

EnergyMatrices energy_matrices(const ReducedModel& model)
{
  return {matrix_of(model.M_z), matrix_of(model.K_z)};
}

Flow flow_of(ReducedMap& map, const EnergyMatrices& energy)
{
  const auto period_map = [&map](double period, Vec start, Vec end, Vec rate)
  {
    end_if_asked(map.comm);
    const PeriodEnd period_end = end_of_period(map, period, reduced_state(start));
    put(period_end.end, end);
    if (rate) put(period_end.rate, rate);
  };
  return {period_map, energy.M, energy.K};
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

Preconditioner preconditioner_of(const MonodromyCorrection& correction, ReducedCoordinates coordinates)
{
  return [&correction, coordinates = std::move(coordinates)](double, Vec x, Vec y)
  {
    const VectorXd seen = coordinates.of(x);
    check(VecAXPBY(y, -1, 0, x));
    coordinates.add(correction.left * (correction.right * seen), y);
  };
}

} // namespace squeal
