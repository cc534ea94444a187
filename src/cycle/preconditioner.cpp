/// P^-1 x = -x + E D E^+ x: the bulk of the period map is linear and known. A state outside the span of the real modes
/// Phi is taken as forgotten within a period (dPhi/dx = 0, inverse -1); inside it motion is sliding about equilibrium,
///     u = u0 + Phi q,   Mc q'' + Cc q' + Kc q = 0,
///     Xc = Phi'X Phi - mu (e.B_t Phi)' L X Phi   for X = M, C + C_f, K;   L: reactions lambda_n of a force,
/// friction on the reactions that the motion takes. N theta steps multiply the eigenvectors (y, lambda y) of it by
///     m = [(1 + (1-theta) lambda h)/(1 - theta lambda h)]^N,   D: 1/(m - 1) + 1.
/// At the cycle the unstable pair has become {1, a contraction}: it is taken to decay at three times the rate of its
/// growth, the followed one in step with the cycle. Near the onset of the instability, where the square of the
/// amplitude limits the growth, the rate is twice; too slow a decay makes the steps too long.
#include "squeal/algebra/multivector.hpp"
#include "squeal/equilibrium/closed_contact.hpp"
#include "squeal/modes/quadratic.hpp"
#include "squeal/shooting/shooting.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <petscblaslapack.h>

namespace squeal
{

namespace
{

using Complex = std::complex<double>;
using Index = std::size_t;

/// P^-1 x = -x + E D E^+ x
struct Sliding
{
  Block shapes;                    // Phi
  std::vector<Complex> lambda;     // [1/s] of the sliding modes, Im >= 0
  Index followed = 0;              // the one that grows most
  std::vector<double> right, left; // Re and Im of its (y, lambda y) a pair, column-major, and the inverse
  int steps = 0;
  double theta = 0.5;
};

/// mu e.B_t Phi, one mode after the other.
std::vector<std::vector<double>> friction_of(const Interface& interface, const std::vector<Owned<Vec>>& shapes)
{
  const Index directions = static_cast<Index>(interface.directions), block = directions + 1;
  const std::vector<double> e = drive_directions(interface);
  std::vector<std::vector<double>> result;
  for (const Owned<Vec>& shape : shapes)
  {
    const std::vector<double> motion = relative(interface, shape);
    std::vector<double>& along = result.emplace_back(static_cast<Index>(interface.pairs));
    for (Index i = 0; i < along.size(); ++i)
      for (Index k = 0; k < directions; ++k)
        along[i] += interface.friction * e[i * directions + k] * motion[i * block + 1 + k];
  }
  return result;
}

/// Xc, column-major.
std::vector<double> on_modes(const std::vector<Owned<Vec>>& shapes, const std::vector<std::vector<double>>& friction,
                             const ClosedContact& contact, Mat X)
{
  const Index n = shapes.size();
  std::vector<double> result(n * n);
  const std::vector<Vec> all(shapes.begin(), shapes.end());
  const Owned<Vec> force = zeros_like(shapes[0]);
  Owned<Vec> reactions;
  check(MatCreateVecs(contact.reaction, nullptr, reactions.put()));
  for (Index j = 0; j < n; ++j)
  {
    check(MatMult(X, shapes[j], force));
    check(VecMDot(force, static_cast<PetscInt>(n), all.data(), &result[j * n]));
    check(MatMult(contact.reaction, force, reactions));
    const std::vector<double> lambda = whole(reactions);
    for (Index i = 0; i < n; ++i)
      for (Index pair = 0; pair < lambda.size(); ++pair) result[i + j * n] -= friction[i][pair] * lambda[pair];
  }
  return result;
}

/// The columns Re and Im of (y, lambda y) of every pair, the real vector alone of a real one.
std::vector<double> real_columns(const std::vector<DenseEigenpair>& pairs)
{
  std::vector<double> result;
  for (const DenseEigenpair& pair : pairs)
    for (int part = 0; part < (pair.lambda.imag() > 0 ? 2 : 1); ++part)
      for (const Complex factor : {Complex(1), pair.lambda})
        for (const Complex entry : pair.y)
          result.push_back(part == 0 ? (factor * entry).real() : (factor * entry).imag());
  return result;
}

std::vector<double> inverse(std::vector<double> A, Index size)
{
  std::vector<double> result(size * size);
  for (Index i = 0; i < size; ++i) result[i * (size + 1)] = 1;
  PetscBLASInt n = static_cast<PetscBLASInt>(size), columns = n, info = 0;
  std::vector<PetscBLASInt> pivots(size);
  LAPACKgesv_(&n, &columns, A.data(), &n, pivots.data(), result.data(), &n, &info);
  if (info != 0) throw Error("cycle: the sliding modes of the preconditioner depend on each other");
  return result;
}

/// 1/(m - 1) + 1 of an eigenvalue; zero where m is 1 (a motion of a free body, or a resonance without damping).
Complex correction(Complex lambda, bool followed, const Sliding& preconditioner, double period)
{
  if (lambda.real() > 0) lambda = {-3 * lambda.real(), followed ? 2 * std::numbers::pi / period : lambda.imag()};
  const double h = period / preconditioner.steps, theta = preconditioner.theta;
  const Complex m = std::pow((1. + (1 - theta) * h * lambda) / (1. - theta * h * lambda), preconditioner.steps);
  return std::abs(m - 1.) < 1e-4 ? 0 : 1. / (m - 1.) + 1.;
}

/// V^-1 (q, q') of every mode, each pair's two coordinates turned by its correction; then V of that.
std::vector<double> corrected(const Sliding& preconditioner, double period, const std::vector<double>& z)
{
  const std::vector<double>&left = preconditioner.left, &right = preconditioner.right;
  const Index n = z.size();
  std::vector<double> along(n), result(n);
  for (Index j = 0; j < n; ++j)
    for (Index i = 0; i < n; ++i) along[i] += left[i + j * n] * z[j];
  Index at = 0;
  for (Index k = 0; k < preconditioner.lambda.size(); ++k)
  {
    const Complex lambda = preconditioner.lambda[k];
    const Complex D = correction(lambda, k == preconditioner.followed, preconditioner, period);
    if (lambda.imag() > 0)
    {
      const Complex turned = D * Complex(along[at], -along[at + 1]);
      along[at++] = turned.real();
      along[at++] = -turned.imag();
    }
    else
      along[at++] *= D.real();
  }
  for (Index j = 0; j < n; ++j)
    for (Index i = 0; i < n; ++i) result[i] += right[i + j * n] * along[j];
  return result;
}

/// From sliding modes y of the shapes' coordinates, all of them; the shapes M-orthonormal. Borrows M.
Preconditioner preconditioner_of(const std::vector<DenseEigenpair>& sliding, const std::vector<Owned<Vec>>& shapes,
                                 Mat M, int steps, double theta)
{
  const Index m = shapes.size();
  Sliding inside{empty_block(M), {}, 0, real_columns(sliding), {}, steps, theta};
  for (const DenseEigenpair& pair : sliding)
  {
    inside.lambda.push_back(pair.lambda);
    if (pair.lambda.real() > inside.lambda[inside.followed].real()) inside.followed = inside.lambda.size() - 1;
  }
  if (inside.right.size() != 4 * m * m) throw Error("cycle: sliding modes are missing from the preconditioner");
  inside.left = inverse(inside.right, 2 * m);
  for (const Owned<Vec>& shape : shapes) append(inside.shapes, shape);
  return [inside = std::move(inside), M](double period, Vec x, Vec y)
  {
    Block sum = empty_block(M);
    for (const Vec half : {displacement(x), velocity(x)}) append(sum, half);
    const std::vector<double> turned = corrected(inside, period, inner(inside.shapes, product(M, sum)));
    std::transform(sum.entries.begin(), sum.entries.end(), sum.entries.begin(), std::negate());
    add_combination(sum, 1, inside.shapes, turned);
    copy_column(sum, 0, displacement(y));
    copy_column(sum, 1, velocity(y));
  };
}

} // namespace

Preconditioner sliding_preconditioner(const Structure& structure, const Interface& interface,
                                      const Equilibrium& equilibrium, const RealModes& modes, int steps, double theta)
{
  const Index m = modes.shapes.size();
  if (m == 0) return {};
  const ClosedContact contact = eliminate_closed_pairs(structure, interface, equilibrium);
  const auto friction = friction_of(interface, modes.shapes);
  const Owned<Mat> C = sliding_damping(structure, interface, equilibrium);
  const auto reduced = [&](Mat X) { return on_modes(modes.shapes, friction, contact, X); };
  return preconditioner_of(solve_dense_quadratic_shared(comm_of(structure.load), static_cast<int>(m),
                                                        reduced(structure.M), reduced(C), reduced(structure.K)),
                           modes.shapes, structure.M, steps, theta);
}

void apply(const Preconditioner& preconditioner, double period, Vec x, Vec y)
{
  if (preconditioner)
    preconditioner(period, x, y);
  else
    check(VecAXPBY(y, -1, 0, x));
}

Border border_at(const Shooting& shooting, const Orbit& orbit)
{
  Border border{zeros_like(orbit.rate), zeros_like(orbit.rate), energy_norm(shooting.flow, orbit.rate), 0};
  energy_image(shooting.flow, orbit.rate, border.phase);
  check(VecScale(border.phase, 1 / border.speed));
  apply(shooting.preconditioner, orbit.period, orbit.rate, border.column);
  check(VecDot(border.phase, border.column, &border.along));
  return border;
}

double close_border(const Border& border, Vec y, double row)
{
  double along = 0;
  check(VecDot(border.phase, y, &along));
  const double t = (along - row) / border.along;
  check(VecAXPY(y, -t, border.column));
  return t;
}

} // namespace squeal
