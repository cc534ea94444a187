#include "polynomial_model.hpp"

#include "squeal/modes/quadratic.hpp"
#include "squeal/scene/numbers.hpp"

#include <algorithm>

namespace squeal
{

namespace
{

constexpr double accepted = 1e-5; // error of M, C and K beside their size: growth rates are off by as much, at most
constexpr double rounding = 1e-12;

/// Whether a number is of a friction law: such laws are exact, and nothing else depends on them.
bool is_friction(const std::string& key)
{
  const auto ends_as = [&](const char* own) { return key.ends_with(own); };
  return key.starts_with("friction.") ||
         (key.starts_with("contact.") &&
          (ends_as(".friction") || ends_as(".static_coefficient") || ends_as(".decay_speed")));
}

double size_of(Mat A)
{
  double size = 0;
  check(MatNorm(A, NORM_FROBENIUS, &size));
  return size;
}

double entries_of(Mat A)
{
  MatInfo info{};
  check(MatGetInfo(A, MAT_LOCAL, &info));
  return info.nz_used;
}

/// Whether two matrices differ by more than rounding: tangents along the drive move by that with its rate.
bool differ(Mat A, Mat B)
{
  const Owned<Mat> difference = copy_of(A);
  check(MatAXPY(difference, -1, B, DIFFERENT_NONZERO_PATTERN));
  return size_of(difference) > rounding * size_of(B);
}

/// A += factor B on equal patterns.
void add(Mat A, double factor, Mat B)
{
  if (entries_of(A) != entries_of(B)) throw Error("a random number changes the pattern of the matrices");
  check(MatAXPY(A, factor, B, SAME_NONZERO_PATTERN));
}

void add(std::vector<double>& a, double factor, const std::vector<double>& b)
{
  for (std::size_t i = 0; i < b.size(); ++i) a[i] += factor * b[i];
}

/// A null matrix in place of one that is rounding.
void drop_if_zero(Owned<Mat>& A, Mat reference)
{
  if (size_of(A) <= rounding * size_of(reference)) A = {};
}

/// A model with C without the viscous equivalent of loss factors.
BrakeModel without_equivalent(BrakeModel model)
{
  Structure& structure = model.structure;
  if (!structure.K_loss.get()) return model;
  structure.C = without_loss(structure.C, structure);
  check(MatSetOption(structure.C, MAT_SYMMETRIC, PETSC_TRUE));
  structure.loss_omega = 0;
  return model;
}

/// The sum of factor times model over a few models, as a term; matrices that vanish are dropped.
ModelTerm sum_of(const std::vector<std::pair<double, const BrakeModel*>>& parts, const BrakeModel& reference)
{
  ModelTerm term;
  for (const auto matrix : matrices_of_structure)
    if ((reference.structure.*matrix).get())
    {
      term.structure.*matrix = copy_of((reference.structure.*matrix).get());
      check(MatZeroEntries((term.structure.*matrix).get()));
    }
  term.structure.load = zeros_like(reference.structure.load);
  term.gap.assign(reference.interface.gap.size(), 0.);
  term.drive.assign(reference.interface.drive.size(), 0.);
  term.compliance.assign(reference.interface.compliance.size(), 0.);
  for (const auto& [factor, model] : parts)
  {
    if (reference.interface.pairs > 0 && differ(model->interface.B, reference.interface.B))
      throw Error("a random number changes the rows of contact: take it out of [[uncertain]]");
    for (const auto matrix : matrices_of_structure)
    {
      const Mat A = (model->structure.*matrix).get();
      if ((A != nullptr) != ((reference.structure.*matrix).get() != nullptr))
        throw Error("a random number brings or takes away what spins: keep its rate on one side of 0");
      if (A) add((term.structure.*matrix).get(), factor, A);
    }
    if (model->interface.compliance.size() != term.compliance.size())
      throw Error("a random number brings or takes away the compliance of contacts: keep it above 0");
    check(VecAXPY(term.structure.load, factor, model->structure.load));
    add(term.gap, factor, model->interface.gap);
    add(term.drive, factor, model->interface.drive);
    add(term.compliance, factor, model->interface.compliance);
  }
  for (const auto matrix : matrices_of_structure)
    if (Owned<Mat>& A = term.structure.*matrix; A.get()) drop_if_zero(A, (reference.structure.*matrix).get());
  return term;
}

} // namespace

PolynomialModel::PolynomialModel(const RobustnessProblem& problem) : problem_(problem)
{
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < problem.numbers.size(); ++i)
  {
    const UncertainNumber& number = problem.numbers[i];
    centre_.push_back(quantile(number, 0.5));
    const double spread = (quantile(number, 0.99) - quantile(number, 0.01)) / 2;
    scale_.push_back(std::min(spread, centre_.back() - quantile(number, 0))); // x = -1 is a scene: skewed ones end near
    if (!is_friction(number.key)) places.push_back(i);
  }
  reference_ = model_at(centre_);
  model_ = model_at(centre_);
  model_.structure.load = copy_of(model_.structure.load); // it is changed from point to point
  terms_.push_back(sum_of({{1, &reference_}}, reference_));
  const auto at = [&](std::initializer_list<std::pair<std::size_t, double>> steps)
  {
    std::vector<double> values = centre_;
    for (const auto& [place, step] : steps) values[place] += step * scale_[place];
    return model_at(values);
  };
  std::vector<BrakeModel> above;
  for (const std::size_t i : places)
  {
    above.push_back(at({{i, 1}}));
    const BrakeModel below = at({{i, -1}});
    terms_.push_back(sum_of({{0.5, &above.back()}, {-0.5, &below}}, reference_));
    terms_.back().factors = {i};
    terms_.push_back(sum_of({{0.5, &above.back()}, {0.5, &below}, {-1, &reference_}}, reference_));
    terms_.back().factors = {i, i};
  }
  for (std::size_t i = 0; i < places.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
    {
      // the squares cancel, so that the product alone is left
      const BrakeModel both = at({{places[i], 1}, {places[j], 1}});
      terms_.push_back(sum_of({{1, &both}, {-1, &above[i]}, {-1, &above[j]}, {1, &reference_}}, reference_));
      terms_.back().factors = {places[j], places[i]};
    }
  std::vector<double> corner = centre_;
  for (const std::size_t i : places)
  {
    const double outer = centre_[i] - 1.3 * scale_[i]; // which may be no scene
    corner[i] = outer >= quantile(problem.numbers[i], 0) ? outer : centre_[i] - 0.6 * scale_[i];
  }
  error_ = error_at(corner);
  if (error_ > accepted)
    throw Error(format("the matrices are no polynomials of second order of the random numbers: off by %.1e", error_));
}

BrakeModel PolynomialModel::model_at(const std::vector<double>& values) const
{
  return without_equivalent(problem_.model_at(values));
}

double PolynomialModel::error_at(const std::vector<double>& values)
{
  const BrakeModel exact = model_at(values);
  const std::vector<double> x = coefficients(values);
  double error = 0;
  for (const auto matrix : matrices_of_structure)
  {
    const Mat whole = (exact.structure.*matrix).get();
    if (!whole) continue;
    const Owned<Mat> difference = copy_of(whole);
    for (std::size_t k = 0; k < terms_.size(); ++k)
      if (const Mat term = (terms_[k].structure.*matrix).get()) add(difference, -x[k], term);
    if (const double size = size_of(whole); size > 0) error = std::max(error, size_of(difference) / size);
  }
  return error;
}

std::vector<double> PolynomialModel::coefficients(const std::vector<double>& values) const
{
  std::vector<double> x;
  for (const ModelTerm& term : terms_)
  {
    double product = 1;
    for (const std::size_t i : term.factors) product *= (values[i] - centre_[i]) / scale_[i];
    x.push_back(product);
  }
  return x;
}

void PolynomialModel::set_friction(const std::vector<double>& values)
{
  model_.interface.friction = problem_.friction_at(values);
}

const BrakeModel& PolynomialModel::at(const std::vector<double>& values)
{
  const std::vector<double> x = coefficients(values);
  auto& [structure, interface] = model_;
  const bool stiffness_changed = stiffness_changes();
  if (stiffness_changed)
  {
    structure.K = copy_of(reference_.structure.K); // others may share the one before
    mark_symmetric(structure.K);
    check(MatZeroEntries(structure.K));
  }
  check(VecSet(structure.load, 0));
  std::ranges::fill(interface.gap, 0.);
  std::ranges::fill(interface.drive, 0.);
  std::ranges::fill(interface.compliance, 0.);
  for (std::size_t k = 0; k < terms_.size(); ++k)
  {
    const ModelTerm& term = terms_[k];
    if (stiffness_changed && term.structure.K.get()) add(structure.K, x[k], term.structure.K);
    check(VecAXPY(structure.load, x[k], term.structure.load));
    add(interface.gap, x[k], term.gap);
    add(interface.drive, x[k], term.drive);
    add(interface.compliance, x[k], term.compliance);
  }
  set_friction(values);
  return model_;
}

bool PolynomialModel::stiffness_changes() const
{
  return std::ranges::any_of(terms_,
                             [](const ModelTerm& term) { return !term.factors.empty() && term.structure.K.get(); });
}

} // namespace squeal
