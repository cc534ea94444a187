#pragma once
/// Contact of one step, linearised at its solution (src/README.md, section 4.13): dr for changes db of w = W r + b,
///     dw = W dr + db;   open: dr = 0;   closed: dw_n = 0
///     stick: dw_t = 0;  slip: dr_t + mu e dr_n + S dw_t = -r_n e dmu,   e = w_t/|w_t|,
///     S = mu r_n/|w_t| (1 - e e') + mu' r_n e e'.
///
/// S is diagonal in the directions along e and across it. Normal rows and those of stick are the leading unknowns; dr_n
/// gives dr_t along e. What is left is y = -S dw_t where S is not zero: across e, and along e where mu changes with
/// speed. With dr = Q x of the unknowns x, and P the rows of dw that they answer to, W whatever it is:
///     A x = -P db,   A = P W Q with rows of y times S, and 1 more on their diagonal.
/// The leading block is factored. Without y, as with one tangential direction and constant mu, that is exact. Else a
/// fixed point finds y, which contracts fast where w_t is large beside its changes. Where it does not, y is eliminated.
#include "squeal/contact/solver.hpp"
#include "squeal/transient/theta_step.hpp"

namespace squeal
{

/// The law of pairs, and theta of the step.
struct ContactLaw
{
  int directions = 0;
  const PairFriction& friction;
  double theta = 0.5;
};

class LinearContact
{
public:
  /// `W`: all its entries.
  LinearContact(const Eigen::Ref<const Eigen::MatrixXd>& W, const ContactLaw& law, const StepRecord& record);

  bool is_open() const { return leading_.empty(); } // all pairs

  /// Memory that it takes [byte].
  double memory() const { return sizeof(double) * static_cast<double>(A_.size()); }

  /// P db of each column.
  Eigen::MatrixXd rows_of(const Eigen::MatrixXd& db) const;
  /// F Q
  Eigen::MatrixXd columns_of(const Eigen::Ref<const Eigen::MatrixXd>& F) const;
  /// x of P db, and its transpose.
  Eigen::MatrixXd solve(Eigen::MatrixXd right) const;
  Eigen::MatrixXd solve_transposed(const Eigen::MatrixXd& right) const;
  /// dr = Q x
  Eigen::MatrixXd reactions(const Eigen::MatrixXd& x) const;

  /// dr of a change 1 of the law's common coefficient where nothing moves: -r_n e dmu.
  const Eigen::VectorXd& by_coefficient() const { return by_coefficient_; }

private:
  using PairMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 2, 2>; // of tangential directions

  struct Slip // of a pair
  {
    Eigen::Index first = 0, normal = 0; // its first tangential row of W, its normal one's place among the unknowns
    PairMatrix turn;                    // [-] columns: e, and the direction across it
    double mu = 0;                      // [-]
  };

  void set_unknowns(const ContactLaw& law, const StepRecord& record);
  void put_rows(const double* column, double* result) const;
  template <class Visit> void for_each_column(const Eigen::Ref<const Eigen::MatrixXd>& F, Visit visit) const;
  template <class Matrix, class Solve>
  Eigen::MatrixXd solve_by_parts(const Matrix& A, const Solve& solve_first, const Eigen::MatrixXd& right) const;
  auto leading_block() const { return A_.topLeftCorner(order_.size(), order_.size()); }
  Eigen::MatrixXd solve_leading(const Eigen::MatrixXd& right) const;
  Eigen::MatrixXd solve_leading_transposed(Eigen::MatrixXd x) const;

  std::vector<Eigen::Index> leading_; // rows of W
  std::vector<Slip> slips_;
  Eigen::Index first_turned_ = 0; // of the directions of `turn`: the first one that has an entry of y
  Eigen::VectorXd S_;             // [N s/m] the diagonal of S, by entries of y: pair by pair
  Eigen::VectorXd by_coefficient_;
  Eigen::MatrixXd A_;     // its leading block as L U
  Eigen::VectorXi order_; // P of P A = L U of that block
};

} // namespace squeal
