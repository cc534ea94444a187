#pragma once
/// A model whose matrices are polynomials of random numbers (src/README.md, section 12.1): sums of models that were
/// assembled at a few values. It lives on one rank.
#include "squeal/study/robustness.hpp"

#include <array>

namespace squeal
{

/// What the numbers change in a structure.
inline constexpr std::array matrices_of_structure = {&Structure::M, &Structure::C, &Structure::K,
                                                     &Structure::G, &Structure::H, &Structure::K_loss};

/// What a product of numbers contributes. Matrices without a contribution are null; C is that without the viscous
/// equivalent of loss factors.
struct ModelTerm
{
  std::vector<std::size_t> factors{}; // none: the constant; twice the same: its square
  Structure structure{};              // its matrices and load
  std::vector<double> gap{}, drive{}, compliance{};
};

class PolynomialModel
{
public:
  /// Error: a number changes the rows of contact, or the model is no polynomial of second order in it.
  explicit PolynomialModel(const RobustnessProblem& problem);

  const std::vector<ModelTerm>& terms() const { return terms_; }

  /// The factors of the terms at some values of the numbers.
  std::vector<double> coefficients(const std::vector<double>& values) const;

  /// K, load, gap, drive, compliance and friction at these values; all else stays that of the medians.
  const BrakeModel& at(const std::vector<double>& values);

  const BrakeModel& reference() const { return reference_; }
  bool stiffness_changes() const;
  double error() const { return error_; } // relative, at a corner of the numbers' ranges

private:
  BrakeModel model_at(const std::vector<double>& values) const;
  void set_friction(const std::vector<double>& values);
  double error_at(const std::vector<double>& values);

  const RobustnessProblem& problem_;
  std::vector<double> centre_, scale_; // of the numbers
  BrakeModel reference_;               // at the centre
  BrakeModel model_;
  std::vector<ModelTerm> terms_;
  double error_ = 0;
};

} // namespace squeal
