#pragma once
/// Contact of one step, linearised at its solution (src/README.md, section 4.13): dr for changes db of w = W r + b,
///     dw = W dr + db;   open: dr = 0;   closed: dw_n = 0
///     stick: dw_t = 0;  slip: dr_t + mu e dr_n + S dw_t = -r_n e dmu,   e = w_t/|w_t|,
///     S = mu r_n/|w_t| (1 - e e') + mu' r_n e e'.
///
/// S is diagonal in the directions along e and across it. Normal rows and those of stick are the first unknowns; dr_n
/// gives dr_t along e. What is left is y = -S dw_t where S is not zero: across e, and along e where mu changes with
/// speed. Without y, as with one tangential direction and constant mu, one factorisation of the first unknowns' system
/// is exact. Else y is found by a fixed point, which contracts fast where w_t is large beside its changes. Where it
/// does not contract, the system of the first unknowns and y is factored.
#include "squeal/contact/interface.hpp"
#include "squeal/contact/solver.hpp"
#include "squeal/transient/step_record.hpp"

#include <Eigen/Core>
#include <span>

namespace squeal
{

/// dr of each column of db, with the change of the law's coefficient of each; every row of W, zeros on open pairs.
/// `W`: all its entries. On rank 0, where W is.
Eigen::MatrixXd linear_contact_response(std::span<const double> W, int directions, const PairFriction& friction,
                                        const StepRecord& record, std::span<const ContactStatus> statuses,
                                        const Eigen::MatrixXd& db, const Eigen::VectorXd& dmu);

} // namespace squeal
