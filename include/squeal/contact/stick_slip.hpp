#pragma once
/// Contact at rest where some pairs have no drive and stick, slip or open by what acts on them (src/README.md, section
/// 2.9). One increment of the load, over all rows of the pairs:
///     N w = q + M r,   w: gaps, with the approach of the pairs' compliance, and slips of the increment,
///     0 <= w_n _|_ r_n >= 0;   undriven: |r_t| <= mu r_n, r_t = -mu r_n w_t/|w_t| where w_t is not 0;
///     driven: r_t = mu r_n e.
/// Where all pairs are driven, rows are normal ones alone: M then holds the friction.
/// Semismooth Newton on the statuses. A status leaves each pair as many unknowns as it has rows, and a linear system.
/// The step in time has the same law with velocities for displacements. Arithmetic of one rank.
#include "squeal/base/dense.hpp"
#include "squeal/contact/pair_law.hpp"

#include <Eigen/LU>
#include <memory>

namespace squeal
{

/// The matrices that increments share.
struct StickSlipOperator
{
  Eigen::MatrixXd N, M; // rows x rows
  int directions = 1;
  std::vector<NaturalScale> rho; // [N/m] of each pair, by its own block of M
  double compliance = 0;         // [m/N] the largest of a row
  std::vector<int> contact;      // number of each pair's: reactions are judged by the largest of their contact

  /// A force [N] that counts as one beside this right-hand side, where a contact is about to open.
  double least_force(const Eigen::VectorXd& q) const { return 1e-6 * q.lpNorm<Eigen::Infinity>() / compliance; }
};

/// `own`: compliance of each row to its own force without friction [m/N]; `contact`: as above.
StickSlipOperator make_stick_slip_operator(Eigen::MatrixXd N, Eigen::MatrixXd M, const Eigen::VectorXd& own,
                                           int directions, std::vector<int> contact);

/// The friction of the pairs in one increment.
struct StickSlipFriction
{
  std::vector<double> mu; // [-] per pair
  std::vector<double> e;  // [-] of driven pairs, zero of undriven ones, as TangentView reads it
};

/// Reactions and motions of the pairs, contact vectors.
struct StickSlipState
{
  Eigen::VectorXd r, w; // [N, m]
};

/// A regular system of statuses on the way to a solution: laws have corners rounded off by a force [N], and all rows
/// springs [N/m].
struct Softening
{
  double force = 0, spring = 0;
};

/// The factored system of a state on the way. Those of states whose laws differ in few pairs are solved by it.
struct StatusFactors;

/// The factored system of the statuses that an increment ended with. Forces are p = proj(r - rho w) with the derivative
/// J: dr = J y + p - r and rho dw = (J - 1) y + p - r fulfil the linearised laws for all y.
class StatusSystem
{
public:
  StatusSystem(const StickSlipOperator& of, const StickSlipFriction& friction, const StickSlipState& at);

  /// Factors of the same operator serve. They are made anew where the laws of many pairs differ from theirs by more
  /// than `near`, a change of J. Pairs that differ by less keep the law of the factors.
  StatusSystem(const StickSlipOperator& of, const StickSlipFriction& friction, const StickSlipState& at,
               const Softening& soft, double near, std::shared_ptr<const StatusFactors>& factors);

  /// The change of the state within the statuses by which N w - M r grows by `rhs`, and the laws' residual goes.
  StickSlipState change(const Eigen::VectorXd& rhs, const Softening& soft) const;

  /// The change within the statuses by `rhs` alone: the laws' residual stays.
  StickSlipState response(const Eigen::VectorXd& rhs) const;

  const std::vector<ContactStatus>& statuses() const { return statuses_; }
  int index() const;                   // sign of the determinant; that of all pairs open, or stuck, is 1
  double reciprocal_condition() const; // smallest over largest pivot

private:
  void read_laws(const StickSlipFriction& friction, const StickSlipState& at, double smooth);
  bool differ_by_rank(double near); // whether factors serve
  void factor(double spring);

  const StickSlipOperator& of_;
  std::vector<Eigen::Matrix3d> laws_; // J of each pair
  std::vector<ContactStatus> statuses_;
  std::shared_ptr<const StatusFactors> factors_;
  StickSlipState particular_; // y = 0
  // the inverse of the factored system, times what the laws of some pairs add to it, and those pairs' rows
  std::vector<Eigen::Index> changed_{};
  Eigen::MatrixXd by_changes_{};
  Eigen::PartialPivLU<Eigen::MatrixXd> own_{}; // 1 + by_changes_ in these rows
};

/// The largest miss of a pair's law, over the largest reaction of its contact, or `least` [N].
double stick_slip_residual(const StickSlipOperator& of, const StickSlipFriction& friction, const StickSlipState& at,
                           double least);

/// How an increment ended.
struct StickSlipSolution
{
  StickSlipState state;
  int iterations = 0;
  double residual = 0; // of the laws, and of N w = q + M r over M's part in it
  bool converged = false;
};

/// Solves one increment from a guess. `factors`: of the last one by this operator, or none; replaced by those it makes.
StickSlipSolution solve_stick_slip(const StickSlipOperator& of, const StickSlipFriction& friction,
                                   const Eigen::VectorXd& q, const StickSlipState& guess,
                                   std::shared_ptr<const StatusFactors>& factors);

} // namespace squeal
