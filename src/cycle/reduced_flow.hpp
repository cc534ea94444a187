#pragma once
/// The reduced model as a flow for shooting (src/README.md, sections 7.5 and 7.6). Its monodromy matrix gives the
/// approximate inverse of a period map's dPhi_T/dx - I.
#include "squeal/reduction/reduced_step.hpp"
#include "squeal/shooting/flow.hpp"

namespace squeal
{

/// A reduced state as a state of one rank's own, and back.
Owned<Vec> vector_of(const ReducedState& state);
ReducedState reduced_state(Vec state);

/// Between motions and their coordinates (q, v) in a reduced model.
struct ReducedCoordinates
{
  std::function<Eigen::VectorXd(Vec motion)> of;
  std::function<void(const Eigen::VectorXd& coordinates, Vec motion)> add; // the motion that has these
};

/// Coordinates of states of the reduced model itself.
ReducedCoordinates own_coordinates();

/// Coordinates of motions (du, v) of the full model. Borrows both.
ReducedCoordinates coordinates_in(const ReducedModel& model, const Structure& structure);

/// New motions like `pattern` with these columns of coordinates.
std::vector<Owned<Vec>> motions_of(const ReducedCoordinates& coordinates, const Eigen::MatrixXd& columns, Vec pattern);

/// M_z and K_z as matrices of one rank's own, for the energy product.
struct EnergyMatrices
{
  Owned<Mat> M, K;
};

EnergyMatrices energy_matrices(const ReducedModel& model);

/// Borrows both. Its map's ranks integrate together and have the same results bit by bit.
Flow flow_of(ReducedMap& map, const EnergyMatrices& energy);

/// D = (dPhi_r/dx S S' - f f^+ - I)^-1 + I at a state of the reduced model, as left x right. f is the flow, along which
/// the border of the shooting decides. S are the coordinates of the slow shapes, since motion in the others is damped
/// out within a period.
struct MonodromyCorrection
{
  Eigen::MatrixXd left, right;
};

/// Collective among the map's ranks.
MonodromyCorrection monodromy_correction(ReducedMap& map, double period, const ReducedState& state);

/// From the columns of a monodromy matrix along the slow coordinates of q and of v, and the flow.
MonodromyCorrection monodromy_correction(const ReducedModel& model, const Eigen::MatrixXd& columns,
                                         const ReducedState& flow);

/// P^-1 x = -x + V D R x: R takes the coordinates, V gives their motion. What they miss is taken as damped out within a
/// period. Borrows D.
Preconditioner preconditioner_of(const MonodromyCorrection& correction, ReducedCoordinates coordinates);

} // namespace squeal
