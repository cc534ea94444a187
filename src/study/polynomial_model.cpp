#include "polynomial_model.hpp"

#include "sliding_basis.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

constexpr double accepted = 1e-5; // error of M, C and K beside their size: growth rates are off by as much, at most
constexpr double rounding = 1e-12;

bool is_friction(const std::string& key)
{
  return key.starts_with("friction.");
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

/// The sum of factor times model over a few models, as a term; M, C and K that vanish are dropped.
ModelTerm sum_of(const std::vector<std::pair<double, const BranchModel*>>& parts, const BranchModel& reference)
{
  ModelTerm term;
  term.M = copy_of(reference.structure.M);
  term.C = copy_of(reference.structure.C);
  term.K = copy_of(reference.structure.K);
  term.load = zeros_like(reference.structure.load);
  for (Mat A : {term.M.get(), term.C.get(), term.K.get()}) check(MatZeroEntries(A));
  term.gap.assign(reference.interface.gap.size(), 0.);
  term.drive.assign(reference.interface.drive.size(), 0.);
  for (const auto& [factor, model] : parts)
  {
    if (reference.interface.pairs > 0 && differ(model->interface.B, reference.interface.B))
      throw Error("a random number changes the rows of contact: take it out of [[uncertain]]");
    add(term.M, factor, model->structure.M);
    add(term.C, factor, model->structure.C);
    add(term.K, factor, model->structure.K);
    check(VecAXPY(term.load, factor, model->structure.load));
    add(term.gap, factor, model->interface.gap);
    add(term.drive, factor, model->interface.drive);
  }
  drop_if_zero(term.M, reference.structure.M);
  drop_if_zero(term.C, reference.structure.C);
  drop_if_zero(term.K, reference.structure.K);
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
    scale_.push_back((quantile(number, 0.99) - quantile(number, 0.01)) / 2);
    if (!is_friction(number.key)) places.push_back(i);
  }
  reference_ = problem.model_at(centre_);
  model_ = problem.model_at(centre_);
  terms_.push_back(sum_of({{1, &reference_}}, reference_));
  const auto at = [&](std::initializer_list<std::pair<std::size_t, double>> steps)
  {
    std::vector<double> values = centre_;
    for (const auto& [place, step] : steps) values[place] += step * scale_[place];
    return problem.model_at(values);
  };
  std::vector<BranchModel> above;
  for (const std::size_t i : places)
  {
    above.push_back(at({{i, 1}}));
    const BranchModel below = at({{i, -1}});
    terms_.push_back(sum_of({{0.5, &above.back()}, {-0.5, &below}}, reference_));
    terms_.back().factors = {i};
    terms_.push_back(sum_of({{0.5, &above.back()}, {0.5, &below}, {-1, &reference_}}, reference_));
    terms_.back().factors = {i, i};
  }
  for (std::size_t i = 0; i < places.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
    {
      const BranchModel both = at({{places[i], 1}, {places[j], 1}});
      terms_.push_back(sum_of({{1, &both}, {-1, &above[i]}, {-1, &above[j]}, {1, &reference_}}, reference_));
      // both - above_i - above_j + centre holds the product alone: the squares cancel
      terms_.back().factors = {places[j], places[i]};
    }
  std::vector<double> corner = centre_;
  for (const std::size_t i : places) corner[i] -= 1.3 * scale_[i];
  error_ = error_at(corner);
  if (error_ > accepted)
    throw Error(format("the matrices are no polynomials of second order of the random numbers: off by %.1e", error_));
}

double PolynomialModel::error_at(const std::vector<double>& values)
{
  const BranchModel exact = problem_.model_at(values);
  const std::vector<double> x = coefficients(values);
  double error = 0;
  for (const auto& [term, whole] :
       {std::pair{&ModelTerm::M, exact.structure.M.get()}, std::pair{&ModelTerm::C, exact.structure.C.get()},
        std::pair{&ModelTerm::K, exact.structure.K.get()}})
  {
    const Owned<Mat> difference = copy_of(whole);
    for (std::size_t k = 0; k < terms_.size(); ++k)
      if ((terms_[k].*term).get()) add(difference, -x[k], terms_[k].*term);
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
  FrictionLaw& law = model_.interface.friction;
  law = problem_.friction;
  for (std::size_t i = 0; i < values.size(); ++i)
  {
    const std::string& key = problem_.numbers[i].key;
    if (key == "friction.coefficient") law.coefficient = values[i];
    if (key == "friction.static_coefficient") law.static_coefficient = values[i];
    if (key == "friction.decay_speed") law.decay_speed = values[i];
  }
}

const BranchModel& PolynomialModel::at(const std::vector<double>& values)
{
  const std::vector<double> x = coefficients(values);
  auto& [structure, interface] = model_;
  if (stiffness_changes()) check(MatZeroEntries(structure.K));
  check(VecSet(structure.load, 0));
  std::ranges::fill(interface.gap, 0.);
  std::ranges::fill(interface.drive, 0.);
  for (std::size_t k = 0; k < terms_.size(); ++k)
  {
    const ModelTerm& term = terms_[k];
    if (stiffness_changes() && term.K.get()) add(structure.K, x[k], term.K);
    check(VecAXPY(structure.load, x[k], term.load));
    add(interface.gap, x[k], term.gap);
    add(interface.drive, x[k], term.drive);
  }
  set_friction(values);
  return model_;
}

bool PolynomialModel::stiffness_changes() const
{
  return std::ranges::any_of(terms_, [](const ModelTerm& term) { return !term.factors.empty() && term.K.get(); });
}

} // namespace squeal
