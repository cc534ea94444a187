#pragma once
/// Contact of one step, linearised at its solution (src/README.md, section 4.13): dr for changes db of w = W r + b,
///     dw = W dr + db;   open: dr = 0;   closed: dw_n = 0
///     stick: dw_t = 0;  slip: dr_t + mu e dr_n + S dw_t = -r_n e dmu,   e = w_t/|w_t|,
///     S = mu r_n/|w_t| (1 - e e') + mu' r_n e e'.
///
/// Normal rows and those of stick are the first unknowns; friction of slip follows. Where S is zero, with one
/// tangential direction and constant mu, one factorisation of the first unknowns' system is exact. Else the term of S
/// is left to a fixed point, which contracts fast where w_t is large beside its changes. Where it does not contract,
/// the system of all rows is factored.
#include "squeal/contact/interface.hpp"
#include "squeal/contact/solver.hpp"
#include "squeal/transient/step_record.hpp"

#include <Eigen/LU>
#include <optional>
#include <span>

namespace squeal
{

/// Lives on rank 0, where W is.
class LinearContact
{
public:
  /// `W`: all its entries.
  LinearContact(std::span<const double> W, int directions, const FrictionLaw& law, const StepRecord& record,
                std::span<const ContactStatus> statuses);

  /// dr of each column of db, with the change of the law's coefficient of each; every row of W, zeros on open pairs.
  Eigen::MatrixXd response(const Eigen::MatrixXd& db, const Eigen::VectorXd& dmu);

private:
  struct Slip // of a pair
  {
    Eigen::Index normal = 0, first = 0; // places of its normal and of its first tangential row among the rows
    Eigen::VectorXd e;                  // [-]
    double mu = 0;                      // [-]
    Eigen::MatrixXd S;                  // [N s/m]
    double by_coefficient = 0;          // [N] r_n dmu/d(coefficient)
  };

  Eigen::MatrixXd by_whole_system(const Eigen::MatrixXd& db, const Eigen::VectorXd& dmu);
  bool by_fixed_point(const Eigen::MatrixXd& db, const Eigen::VectorXd& dmu, Eigen::MatrixXd& dr);

  Eigen::Index size_ = 0, leading_ = 0, directions_ = 0; // all rows of W; the first unknowns; tangential rows of a pair
  std::vector<Eigen::Index> rows_;                       // of the closed pairs in W: first unknowns, then those of slip
  std::vector<Slip> slips_;
  Eigen::MatrixXd W_; // on `rows_`
  std::optional<Eigen::PartialPivLU<Eigen::MatrixXd>> leading_lu_, whole_lu_;
};

} // namespace squeal
