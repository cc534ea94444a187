/// Times squeal's supernodal Cholesky beside CHOLMOD's on the step matrix A of a matrix folder, for tools/bench: one
/// line of JSON on standard output.
///     bench_cholmod FOLDER STATE h mu rounds
/// The two alternate in every round; figures are medians of processor seconds. CHOLMOD has no partial factorisation, so
/// W = B A^-1 B' is formed in two ways:
///     columns:  A^-1 B' by solves with many right-hand sides;
///     bordered: the factor of [A B'; B sigma I] with B's rows last leaves L22 L22' = sigma I - W.
/// A step with CHOLMOD takes two solves with A, one before contact and one after; squeal takes two halves of one.
#include "bench_timing.hpp"
#include "bench_trajectories.hpp"
#include "cholmod_handles.hpp"
#include "squeal/algebra/bordered_factor.hpp"
#include "squeal/options.hpp"
#include "squeal/transient/transient.hpp"

#include <cmath>
#include <cstdio>
#include <Eigen/Dense>
#include <map>
#include <numeric>

using namespace squeal;

namespace
{

using Figures = std::map<std::string, std::vector<double>>;

std::size_t at(int number)
{
  return static_cast<std::size_t>(number);
}

int rows_of(Mat A)
{
  PetscInt rows = 0;
  check(MatGetSize(A, &rows, nullptr));
  return static_cast<int>(rows);
}

/// The upper triangle of A.
Columns upper_triangle(Mat A)
{
  Columns upper;
  for_each_row(A,
               [&](PetscInt row, std::span<const PetscInt> columns, std::span<const PetscScalar> values)
               {
                 for (std::size_t k = 0; k < columns.size() && columns[k] <= row; ++k) upper.add(columns[k], values[k]);
                 upper.end_column();
               });
  return upper;
}

/// B' behind `columns`; with a `corner` above zero, that on the diagonal below.
void append_transposed(Mat B, int dofs, double corner, Columns& columns)
{
  for_each_row(B,
               [&](PetscInt row, std::span<const PetscInt> places, std::span<const PetscScalar> values)
               {
                 for (std::size_t k = 0; k < places.size(); ++k) columns.add(places[k], values[k]);
                 if (corner > 0) columns.add(dofs + row, corner);
                 columns.end_column();
               });
}

Held<cholmod_factor> analysed(cholmod_sparse* A, int ordering, std::vector<int>* order, Common& common)
{
  common.nmethods = 1;
  common.method[0].ordering = ordering;
  common.postorder = 1;
  return hold(cholmod_analyze_p(A, order ? order->data() : nullptr, nullptr, 0, &common), common);
}

Held<cholmod_factor> factored(cholmod_sparse* A, int ordering, std::vector<int>* order, Common& common)
{
  Held<cholmod_factor> L = analysed(A, ordering, order, common);
  cholmod_factorize(A, L.get(), &common);
  if (common.status != CHOLMOD_OK || !L->is_super) throw Error("CHOLMOD made no supernodal factor");
  return L;
}

/// The ordering whose factor has the fewest entries.
int best_ordering(cholmod_sparse* A, Common& common)
{
  int best = CHOLMOD_AMD;
  double least = INFINITY;
  for (const int ordering : {CHOLMOD_AMD, CHOLMOD_METIS, CHOLMOD_NESDIS})
  {
    const Held<cholmod_factor> L = analysed(A, ordering, nullptr, common);
    if (common.lnz >= least) continue;
    best = ordering;
    least = common.lnz;
  }
  return best;
}

/// W by dense blocks of columns of A^-1 B', row-major and whole.
std::vector<double> by_columns(cholmod_factor* L, cholmod_sparse* Bt, Common& common)
{
  constexpr std::size_t wide = 256;
  const std::size_t dofs = Bt->nrow, border = Bt->ncol;
  const auto* starts = static_cast<const int*>(Bt->p);
  const auto* rows = static_cast<const int*>(Bt->i);
  const auto* values = static_cast<const double*>(Bt->x);
  std::vector<double> W(border * border);
  cholmod_dense *solution = nullptr, *Y = nullptr, *E = nullptr;
  for (std::size_t first = 0; first < border; first += wide)
  {
    const std::size_t columns = std::min(wide, border - first);
    const Held<cholmod_dense> right = hold(cholmod_zeros(dofs, columns, CHOLMOD_REAL, &common), common);
    for (std::size_t j = 0; j < columns; ++j)
      for (int k = starts[first + j]; k < starts[first + j + 1]; ++k)
        static_cast<double*>(right->x)[j * dofs + at(rows[k])] = values[k];
    cholmod_solve2(CHOLMOD_A, L, right.get(), nullptr, &solution, nullptr, &Y, &E, &common);
    for (std::size_t j = 0; j < columns; ++j)
      for (std::size_t i = 0; i < border; ++i)
        for (int k = starts[i]; k < starts[i + 1]; ++k)
          W[(first + j) * border + i] += values[k] * static_cast<const double*>(solution->x)[j * dofs + at(rows[k])];
  }
  for (cholmod_dense* X : {solution, Y, E}) cholmod_free_dense(&X, &common);
  return W;
}

/// The last `border` rows and columns of L, column-major, zero above the diagonal.
std::vector<double> last_triangle(const cholmod_factor* L, std::size_t border)
{
  std::vector<double> triangle(border * border);
  const std::size_t dofs = L->n - border;
  const auto *super = static_cast<const int*>(L->super), *pi = static_cast<const int*>(L->pi),
             *px = static_cast<const int*>(L->px), *rows = static_cast<const int*>(L->s);
  for (std::size_t s = 0; s < L->nsuper; ++s)
    for (int column = std::max(super[s], static_cast<int>(dofs)); column < super[s + 1]; ++column)
      for (int k = column - super[s]; k < pi[s + 1] - pi[s]; ++k)
        triangle[(at(column) - dofs) * border + at(rows[pi[s] + k]) - dofs] =
            static_cast<const double*>(L->x)[px[s] + (column - super[s]) * (pi[s + 1] - pi[s]) + k];
  return triangle;
}

/// sigma I - T T' of a lower triangle, by blocks of columns, whole.
std::vector<double> sigma_minus_square(const std::vector<double>& triangle, std::size_t size, double sigma)
{
  std::vector<double> entries(size * size);
  const auto n = static_cast<Eigen::Index>(size);
  const Eigen::Map<const Eigen::MatrixXd> T(triangle.data(), n, n);
  Eigen::Map<Eigen::MatrixXd> W(entries.data(), n, n);
  W.diagonal().setConstant(sigma);
  constexpr Eigen::Index wide = 128;
  for (Eigen::Index first = 0; first < n; first += wide)
  {
    const Eigen::Index width = std::min(wide, n - first), depth = first + width;
    W.block(first, first, n - first, width).noalias() -=
        T.block(first, 0, n - first, depth) * T.block(first, 0, width, depth).transpose();
    W.block(first, depth, width, n - depth) = W.block(depth, first, n - depth, width).transpose();
  }
  return entries;
}

/// W from the factor of the bordered matrix, its border last.
std::vector<double> by_border(cholmod_sparse* extended, std::size_t border, int ordering, cholmod_sparse* A,
                              double sigma, Common& common)
{
  std::vector<int> order(extended->ncol);
  std::iota(order.begin(), order.end(), 0);
  {
    const Held<cholmod_factor> plain = analysed(A, ordering, nullptr, common);
    std::copy_n(static_cast<const int*>(plain->Perm), A->ncol, order.begin());
  }
  const Held<cholmod_factor> L = factored(extended, CHOLMOD_GIVEN, &order, common);
  for (std::size_t i = A->ncol; i < order.size(); ++i)
    if (at(static_cast<const int*>(L->Perm)[i]) != i) throw Error("CHOLMOD moved the border");
  return sigma_minus_square(last_triangle(L.get(), border), border, sigma);
}

/// Largest difference of two vectors, relative to the largest entry.
double difference(const std::vector<double>& a, const double* b)
{
  double worst = 0, largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
  {
    worst = std::max(worst, std::abs(a[i] - b[i]));
    largest = std::max(largest, std::abs(a[i]));
  }
  return worst / largest;
}

double row_sum(const std::vector<double>& W, std::size_t size)
{
  double largest = 0;
  for (std::size_t i = 0; i < size; ++i)
  {
    double sum = 0;
    for (std::size_t j = 0; j < size; ++j) sum += std::abs(W[i * size + j]);
    largest = std::max(largest, sum);
  }
  return largest;
}

/// What one factor holds and how far its answers lie from squeal's.
struct Comparison
{
  double own_entries = 0, their_entries = 0, own_memory = 0, their_memory = 0, their_memory_W = 0;
  double difference_W = 0, difference_x = 0;
  int ordering = 0;
};

/// Most memory that CHOLMOD held since the last call [bytes].
double take_peak(Common& common)
{
  return static_cast<double>(std::exchange(common.memory_usage, common.memory_inuse));
}

/// Factor and W by CHOLMOD, beside squeal's W.
void time_cholmod(Mat A, Mat B, const std::vector<double>& W, Figures& figures, Comparison& comparison)
{
  const std::size_t border = at(rows_of(B));
  const int dofs = rows_of(A);
  const double sigma = 2 * row_sum(W, border);
  Common common;
  Columns columns = upper_triangle(A), others;
  const Held<cholmod_sparse> upper = columns.to_cholmod(at(dofs), 1, common);
  append_transposed(B, dofs, sigma, columns);
  const Held<cholmod_sparse> extended = columns.to_cholmod(at(dofs) + border, 1, common);
  append_transposed(B, dofs, 0, others);
  const Held<cholmod_sparse> Bt = others.to_cholmod(at(dofs), 0, common);
  if (comparison.ordering == 0) comparison.ordering = best_ordering(upper.get(), common);
  std::vector<double> theirs;
  const double inputs = static_cast<double>(common.memory_inuse);
  take_peak(common);
  {
    Held<cholmod_factor> L{nullptr, Free{&common}};
    figures["CHOLMOD factor"].push_back(
        seconds_of([&] { L = factored(upper.get(), comparison.ordering, nullptr, common); }));
    comparison.their_entries = common.lnz;
    comparison.their_memory = take_peak(common) - inputs;
    figures["CHOLMOD W columns"].push_back(seconds_of([&] { theirs = by_columns(L.get(), Bt.get(), common); }));
  }
  take_peak(common);
  comparison.difference_W = std::max(comparison.difference_W, difference(W, theirs.data()));
  figures["CHOLMOD W bordered"].push_back(
      seconds_of([&] { theirs = by_border(extended.get(), border, comparison.ordering, upper.get(), sigma, common); }));
  comparison.their_memory_W = take_peak(common) - inputs + 8. * static_cast<double>(border * border);
  comparison.difference_W = std::max(comparison.difference_W, difference(W, theirs.data()));
}

/// Factor and W, `rounds` times each.
void compare_factors(Mat A, Mat B, int rounds, Figures& figures, Comparison& comparison)
{
  for (int round = 0; round < rounds; ++round)
  {
    std::vector<double> W;
    figures["factor and W"].push_back(seconds_of(
        [&]
        {
          Factor factor(A, B, FactorOptions{.kind = FactorKind::supernodal});
          W = factor.condensed(1);
        }));
    figures["factor"].push_back(seconds_of([&] { Factor(A, nullptr, FactorOptions{.kind = FactorKind::supernodal}); }));
    time_cholmod(A, B, W, figures, comparison);
  }
  comparison.own_entries = Factor(A, nullptr, FactorOptions{.kind = FactorKind::supernodal}).entries();
  comparison.own_memory = forecast_factor(A, B, {}).bytes + 8. * std::pow(rows_of(B), 2);
}

/// Right-hand sides of several trajectories, for either library, and their solutions.
struct RightSides
{
  std::vector<Owned<Vec>> b, x;
  Held<cholmod_dense> dense;
};

RightSides right_sides(const std::vector<State>& states, Common& common)
{
  const std::vector<double> first = all_entries(states[0].v);
  RightSides sides{{}, {}, hold(cholmod_zeros(first.size(), states.size(), CHOLMOD_REAL, &common), common)};
  auto* column = static_cast<double*>(sides.dense->x);
  for (const State& state : states)
  {
    sides.b.push_back(copy_of(state.v));
    sides.x.push_back(zeros_like(state.v));
    const std::vector<double> entries = all_entries(state.v);
    column = std::copy(entries.begin(), entries.end(), column);
  }
  return sides;
}

/// The model whose steps are timed, and where they start.
struct SteppedModel
{
  const ThetaStep& step;
  const Structure& structure;
  const Interface& interface;
  const State& start;
};

/// `count` trajectories together: a step, its two halves of a solve, one solve with A alone, and one by CHOLMOD.
void compare_solves(const SteppedModel& model, int count, int rounds, Figures& figures, Comparison& comparison)
{
  const auto& [step, structure, interface, start] = model;
  const std::string name = std::to_string(count);
  const Owned<Mat> A = step_matrix(structure, step.h, step.theta);
  const Factor plain(A, nullptr, FactorOptions{.kind = FactorKind::supernodal});
  Common common;
  const Held<cholmod_factor> L =
      factored(upper_triangle(A).to_cholmod(at(rows_of(A)), 1, common).get(), comparison.ordering, nullptr, common);
  auto [states, works] = trajectories_from(start, count, step, structure, interface);
  const RightSides sides = right_sides(states, common);
  const std::vector<Vec> b(sides.b.begin(), sides.b.end()), x(sides.x.begin(), sides.x.end());
  const std::vector<double> no_reactions(interface.size() * at(count), 0.);
  cholmod_dense *solution = nullptr, *Y = nullptr, *E = nullptr;
  for (int round = 0; round < rounds; ++round)
  {
    figures["step " + name].push_back(seconds_of([&] { advance(step, structure, interface, works, states); }));
    figures["halves " + name].push_back(seconds_of(
        [&]
        {
          step.factor.forward(b);
          step.factor.backward(no_reactions, x);
        }));
    figures["solve " + name].push_back(seconds_of(
        [&]
        {
          plain.forward(b);
          plain.backward({}, x);
        }));
    figures["CHOLMOD solve " + name].push_back(seconds_of(
        [&] { cholmod_solve2(CHOLMOD_A, L.get(), sides.dense.get(), nullptr, &solution, nullptr, &Y, &E, &common); }));
  }
  comparison.difference_x =
      std::max(comparison.difference_x, difference(all_entries(x[0]), static_cast<const double*>(solution->x)));
  for (cholmod_dense* block : {solution, Y, E}) cholmod_free_dense(&block, &common);
}

void run(int argc, char** argv)
{
  if (argc < 6) throw Error("bench_cholmod FOLDER STATE h mu rounds");
  const double h = std::stod(argv[3]), mu = std::stod(argv[4]);
  const int rounds = std::stoi(argv[5]);
  const MPI_Comm comm = PETSC_COMM_WORLD;
  const Structure structure = read_structure(argv[1], comm);
  const Interface interface = read_interface(argv[1], structure, {mu, true}, comm);
  const State start = read_state(argv[2], structure);
  Figures figures;
  Comparison comparison;
  {
    const Owned<Mat> A = step_matrix(structure, h, 0.5);
    compare_factors(A, interface.B, rounds, figures, comparison);
  }
  const StepOptions options = read_program_options(comm).step;
  const ThetaStep step = make_theta_step(structure, interface, h, 0.5, options);
  for (const int count : {1, 16})
    compare_solves({step, structure, interface, start}, count, 7 * rounds, figures, comparison);
  std::printf("{\"dofs\": %d, \"border\": %zu, \"ordering\": %d, \"entries\": %.6g, \"CHOLMOD entries\": %.6g, "
              "\"memory\": %.4g, \"CHOLMOD memory\": %.4g, \"CHOLMOD memory W\": %.4g, \"difference W\": %.2g, "
              "\"difference x\": %.2g",
              rows_of(structure.K), interface.size(), comparison.ordering, comparison.own_entries,
              comparison.their_entries, comparison.own_memory, comparison.their_memory, comparison.their_memory_W,
              comparison.difference_W, comparison.difference_x);
  for (const auto& [name, values] : figures) std::printf(", \"%s\": %.4g", name.c_str(), median(values));
  std::printf("}\n");
}

} // namespace

int main(int argc, char** argv)
{
  return bench_main("bench_cholmod", argc, argv, [&] { run(argc, argv); });
}
