#include "squeal/equilibrium/linearised_sliding.hpp"

#include "squeal/algebra/sparse_matrices.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace squeal
{

namespace
{

// Coefficients of one degree of freedom in B_n and in B_n + mu e.B_t: both are eliminated side by side.
struct Coefficients
{
  double normal = 0, sliding = 0;
};

// Columns from `dofs` on record the elimination itself: they start as the identity and end as its inverse.
using Row = std::map<PetscInt, Coefficients>;

// The rows that hold a column. A row loses none but its pivots' columns, which no row takes again.
using Holders = std::map<PetscInt, std::vector<std::size_t>>;

// A row that is eliminated. Of a pair that slides it is the normal one, with friction in the other basis. Of one that
// sticks it is each of them, alike in both.
struct HeldRow
{
  int pair;
  PetscInt component; // 0: normal
};

// Rows of closed pairs, of driven ones first: rows that these imply are left out.
std::vector<HeldRow> held_rows(const Interface& interface, const std::vector<char>& closed)
{
  std::vector<HeldRow> sliding, sticking;
  for (int pair = 0; pair < interface.pairs; ++pair)
  {
    const auto i = static_cast<std::size_t>(pair);
    if (!closed[i]) continue;
    const bool rigid = compliance_of(interface, i) == 0, sticks = is_undriven(interface, i);
    if (rigid) (sticks ? sticking : sliding).push_back({pair, 0});
    for (int k = 1; sticks && slip_compliance_of(interface, i) == 0 && k <= interface.directions; ++k)
      sticking.push_back({pair, k});
  }
  sliding.insert(sliding.end(), sticking.begin(), sticking.end());
  return sliding;
}

// The rows of B, whole on every rank: they are few, and the elimination is the same everywhere.
std::vector<Row> read_rows(const Interface& interface, const std::vector<HeldRow>& held)
{
  const PairRows<PetscInt> rows(interface.directions);
  constexpr std::size_t none = -1;
  std::vector<std::size_t> held_of(interface.size(), none); // that a row of B is part of
  for (std::size_t i = 0; i < held.size(); ++i)
  {
    const auto [pair, component] = held[i];
    const PetscInt last = is_undriven(interface, static_cast<std::size_t>(pair)) ? component : rows.directions;
    std::fill_n(held_of.begin() + rows.normal(pair) + component, last - component + 1, i);
  }
  const PetscInt pair_rows = row_count(interface.B), dofs = column_count(interface.B);
  Owned<IS> row_set, column_set;
  check(ISCreateStride(PETSC_COMM_SELF, pair_rows, 0, 1, row_set.put()));
  check(ISCreateStride(PETSC_COMM_SELF, dofs, 0, 1, column_set.put()));
  const IS wanted_rows = row_set, wanted_columns = column_set;
  Mat* parts = nullptr;
  check(MatCreateSubMatrices(interface.B, 1, &wanted_rows, &wanted_columns, MAT_INITIAL_MATRIX, &parts));
  const std::vector<double> directions = drive_directions(interface), mu = drive_friction(interface);
  const TangentView e(directions, interface.directions);
  std::vector<Row> result(held.size());
  for_each_row(parts[0],
               [&](PetscInt row, std::span<const PetscInt> column, std::span<const PetscScalar> value)
               {
                 const std::size_t i = held_of[static_cast<std::size_t>(row)];
                 if (i == none) return;
                 const auto pair = static_cast<std::size_t>(held[i].pair);
                 const PetscInt component = rows.component_of(row);
                 const bool own = component == held[i].component; // else friction that follows the normal row
                 const double weight = own ? 1 : mu[pair] * e.of(pair)[static_cast<std::size_t>(component - 1)];
                 for (std::size_t j = 0; j < column.size(); ++j)
                 {
                   if (value[j] == 0) continue;
                   Coefficients& entry = result[i][column[j]];
                   if (own) entry.normal += value[j];
                   entry.sliding += weight * value[j];
                 }
               });
  check(MatDestroySubMatrices(1, &parts));
  return result;
}

// The degree of freedom large in both rows; one that no other row holds is preferred, since nothing then fills in.
PetscInt choose_pivot(const Row& row, const Holders& holders, PetscInt dofs, double vanishing)
{
  double largest_normal = 0, largest_sliding = 0;
  for (const auto& [column, value] : row)
    if (column < dofs)
    {
      largest_normal = std::max(largest_normal, std::abs(value.normal));
      largest_sliding = std::max(largest_sliding, std::abs(value.sliding));
    }
  if (largest_normal <= vanishing || largest_sliding <= vanishing) return -1;
  PetscInt best = -1;
  double best_score = 1e-6;
  for (const auto& [column, value] : row)
  {
    if (column >= dofs) continue;
    const double score = std::min(std::abs(value.normal) / largest_normal, std::abs(value.sliding) / largest_sliding) *
                         (holders.at(column).size() == 1 ? 1 : 0.1);
    if (score < best_score * (1 - 1e-9)) continue; // of equals the last, whatever the rounding
    best = column;
    best_score = score;
  }
  return best;
}

// rows[j] -= rows[j][pivot] * pivot_row, which holds 1 at the pivot
void subtract(std::vector<Row>& rows, std::size_t j, const Row& pivot_row, PetscInt pivot, Holders& holders)
{
  Row& row = rows[j];
  const Coefficients factor = row.at(pivot);
  for (const auto& [column, value] : pivot_row)
  {
    const auto [entry, is_new] = row.try_emplace(column);
    if (is_new) holders[column].push_back(j);
    entry->second.normal -= factor.normal * value.normal;
    entry->second.sliding -= factor.sliding * value.sliding;
  }
  row.erase(pivot);
}

double size_of(const Row& row)
{
  double largest = 0;
  for (const auto& [column, value] : row) largest = std::max(largest, std::abs(value.normal));
  return largest;
}

// Leaves out a row of a pair that sticks where the rows before it imply it in both bases. Returns whether they do.
bool leave_out_implied(std::vector<Row>& rows, std::size_t i, PetscInt dofs, double vanishing, Holders& holders)
{
  for (const auto& [column, value] : rows[i])
    if (column < dofs && std::max(std::abs(value.normal), std::abs(value.sliding)) > vanishing) return false;
  for (const auto& [column, value] : rows[i]) std::erase(holders.at(column), i);
  rows[i].clear();
  return true;
}

// Gauss-Jordan: on return row i holds 1 at pivots[i], and no other row holds that column; -1: the row is left out.
std::vector<PetscInt> eliminate(std::vector<Row>& rows, const std::vector<HeldRow>& held, const Interface& interface,
                                PetscInt dofs)
{
  Holders holders;
  std::vector<double> size(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i)
  {
    size[i] = size_of(rows[i]);
    rows[i][dofs + static_cast<PetscInt>(i)] = {1, 1};
    for (const auto& [column, value] : rows[i]) holders[column].push_back(i);
  }
  std::vector<PetscInt> pivots;
  for (std::size_t i = 0; i < rows.size(); ++i)
  {
    const PetscInt pivot = choose_pivot(rows[i], holders, dofs, 1e-10 * size[i]);
    const bool sticks = is_undriven(interface, static_cast<std::size_t>(held[i].pair));
    if (pivot < 0 && sticks && leave_out_implied(rows, i, dofs, 1e-10 * size[i], holders))
    {
      pivots.push_back(-1);
      continue;
    }
    if (pivot < 0)
      throw Error("contact pair " + std::to_string(held[i].pair) +
                  " cannot be eliminated: the other closed pairs or the supports already fix its normal motion, or the "
                  "friction coefficient jams it; remove the pair, or free one of its nodes");
    const Coefficients scale = rows[i].at(pivot);
    for (auto& [column, value] : rows[i]) value = {value.normal / scale.normal, value.sliding / scale.sliding};
    pivots.push_back(pivot);
    const std::vector<std::size_t> others = std::exchange(holders.at(pivot), {i});
    for (const std::size_t j : others)
      if (j != i) subtract(rows, j, rows[i], pivot, holders);
  }
  return pivots;
}

struct Elimination
{
  const std::vector<Row>& rows;
  std::map<PetscInt, std::size_t> row_of; // of a pivot
  std::vector<PetscInt> pivots;           // ascending
  PetscInt dofs = 0;

  PetscInt kept_before(PetscInt dof) const
  {
    return dof - static_cast<PetscInt>(std::lower_bound(pivots.begin(), pivots.end(), dof) - pivots.begin());
  }
};

// A row of Z or Y: du at `dof` from the kept degrees of freedom.
SparseRow basis_row(const Elimination& elimination, PetscInt dof, double Coefficients::*kind)
{
  const auto row = elimination.row_of.find(dof);
  if (row == elimination.row_of.end()) return {{elimination.kept_before(dof), 1}};
  SparseRow result;
  for (const auto& [column, value] : elimination.rows[row->second])
    if (column != dof && column < elimination.dofs) result[elimination.kept_before(column)] = -(value.*kind);
  return result;
}

Owned<Mat> assemble_basis(const Elimination& elimination, double Coefficients::*kind, Mat pattern)
{
  const auto [first, last] = own_rows(pattern);
  std::vector<SparseRow> rows;
  for (PetscInt dof = first; dof < last; ++dof) rows.push_back(basis_row(elimination, dof, kind));
  return matrix_of_rows(rows, elimination.kept_before(last) - elimination.kept_before(first), comm_of(pattern));
}

// R'[pivots] lambda = f[pivots], and the elimination found T with T R[pivots] = I: lambda = T' f[pivots]. Likewise of
// B_n.
Owned<Mat> assemble_reaction(const Elimination& elimination, double Coefficients::*kind, ReactionRows wanted,
                             const std::vector<HeldRow>& held, const Interface& interface)
{
  const std::vector<Row>& rows = elimination.rows;
  const bool normal = wanted == ReactionRows::normal;
  const PetscInt dofs = elimination.dofs, of_a_pair = normal ? 1 : interface.directions;
  const PetscInt dofs_here = own_columns(interface.B).size();
  const auto [first, last] = local_range(interface.pairs * of_a_pair, comm_of(interface.B));
  std::vector<SparseRow> own(static_cast<std::size_t>(last - first));
  for (const auto& [pivot, i] : elimination.row_of)
    for (auto entry = rows[i].lower_bound(dofs); entry != rows[i].end(); ++entry)
    {
      const auto [pair, component] = held[static_cast<std::size_t>(entry->first - dofs)];
      if ((component == 0) != normal) continue;
      const PetscInt row = normal ? pair : pair * of_a_pair + component - 1;
      if (row >= first && row < last) own[static_cast<std::size_t>(row - first)][pivot] = entry->second.*kind;
    }
  return matrix_of_rows(own, dofs_here, comm_of(interface.B));
}

} // namespace

ClosedContact eliminate_closed_pairs(const Structure& structure, const Interface& interface,
                                     const std::vector<char>& closed)
{
  ClosedContact result;
  const std::vector<HeldRow> held = held_rows(interface, closed);
  for (const auto& [pair, component] : held)
    if (component == 0) result.pairs.push_back(pair);
  std::ranges::sort(result.pairs);
  std::vector<Row> rows = read_rows(interface, held);
  const PetscInt dofs = row_count(structure.K);
  const std::vector<PetscInt> pivots = eliminate(rows, held, interface, dofs);
  Elimination elimination{rows, {}, {}, dofs};
  for (std::size_t i = 0; i < pivots.size(); ++i)
    if (pivots[i] >= 0)
    {
      elimination.row_of[pivots[i]] = i;
      elimination.pivots.push_back(pivots[i]);
    }
    else
      ++result.dependent_rows;
  std::sort(elimination.pivots.begin(), elimination.pivots.end());
  result.Z = assemble_basis(elimination, &Coefficients::normal, structure.K);
  result.Y = assemble_basis(elimination, &Coefficients::sliding, structure.K);
  const auto reaction_of = [&](double Coefficients::*kind, ReactionRows wanted)
  { return assemble_reaction(elimination, kind, wanted, held, interface); };
  result.reaction = reaction_of(&Coefficients::sliding, ReactionRows::normal);
  result.normal_reaction = reaction_of(&Coefficients::normal, ReactionRows::normal);
  if (has_undriven_pairs(interface)) result.friction = reaction_of(&Coefficients::sliding, ReactionRows::tangential);
  result.pivots = elimination.pivots;
  return result;
}

Owned<Mat> project_symmetric(Mat A, Mat Z)
{
  Owned<Mat> result = project(A, Z, Z); // MatPtAP takes three times as long
  check(MatSetOption(result, MAT_SYMMETRIC, PETSC_TRUE));
  return result;
}

Owned<Mat> project(Mat A, Mat Y, Mat Z)
{
  if (!A) return {};
  // among ranks PETSc's own choices take three times as long
  const auto multiply = [](Mat L, Mat R, MatProductType type, MatProductAlgorithm among_ranks)
  {
    Owned<Mat> result;
    check(MatProductCreate(L, R, nullptr, result.put()));
    check(MatProductSetType(result, type));
    if (ranks_of(comm_of(L)) > 1) check(MatProductSetAlgorithm(result, among_ranks));
    check(MatProductSetFromOptions(result));
    check(MatProductSymbolic(result));
    check(MatProductNumeric(result));
    return result;
  };
  const Owned<Mat> AZ = multiply(A, Z, MATPRODUCT_AB, "seqmpi");
  Owned<Mat> result = multiply(Y, AZ, MATPRODUCT_AtB, "at*b");
  check(MatProductClear(result)); // else it keeps A Z and the work of the product
  return result;
}

std::vector<std::complex<double>> reactions_of(const SlidingEquilibrium& sliding, const LinearisedSliding& linearised,
                                               ReactionRows rows, std::complex<double> s, Vec real, Vec imaginary)
{
  const auto& [structure, interface, equilibrium] = sliding;
  const Mat K = linearised.K.get() ? linearised.K.get() : structure.K.get();
  const Mat by = rows == ReactionRows::normal ? linearised.contact.reaction : linearised.contact.friction;
  const Owned<Vec> re = zeros_like(real), im = zeros_like(real), result = vector_of_rows(by);
  quadratic_residual({structure.M, linearised.C, K}, s, {real, imaginary}, {re, im});
  const std::vector<double> compliance = compliance_of_rows(interface);
  const auto rows_of = [&](const std::vector<double>& of, std::size_t pair)
  {
    const PairView view(of, interface.directions);
    return rows == ReactionRows::normal ? view.of(pair).first(1) : view.tangential(pair);
  };
  const auto part_of = [&](Vec force, Vec motion)
  {
    check(MatMult(by, force, result));
    std::vector<double> part = all_entries(result);
    if (compliance.empty()) return part;
    const std::vector<double> moved = relative(interface, motion);
    for (std::size_t i = 0, at = 0; i < interface.gap.size(); ++i)
      for (std::size_t k = 0; k < rows_of(moved, i).size(); ++k, ++at)
        if (const double c = rows_of(compliance, i)[k]; c > 0 && equilibrium.closed[i])
          part[at] = -rows_of(moved, i)[k] / c;
    return part;
  };
  const std::vector<double> first = part_of(re, real), second = part_of(im, imaginary);
  std::vector<std::complex<double>> reactions;
  for (std::size_t i = 0; i < first.size(); ++i) reactions.emplace_back(first[i], second[i]);
  return reactions;
}

Owned<Mat> sum_of(Mat A, Mat B)
{
  Owned<Mat> result = copy_of(B);
  check(MatAXPY(result, 1, A, DIFFERENT_NONZERO_PATTERN));
  return result;
}

Owned<Mat> sliding_damping(const SlidingEquilibrium& sliding)
{
  const auto& [structure, interface, equilibrium] = sliding;
  const auto part = interface.friction.common.direction_damping ? FrictionDamping::whole : FrictionDamping::of_speed;
  Owned<Mat> result = copy_of(structure.C);
  if (const Owned<Mat> Cf = friction_damping(interface, equilibrium.closed, equilibrium.reactions, part); Cf.get())
    check(MatAXPY(result, 1, Cf, UNKNOWN_NONZERO_PATTERN));
  if (structure.G.get()) result = sum_of(result, structure.G);
  return result;
}

namespace
{

/// The contact with pairs that slipped on the load path sliding along their last friction, where that is asked for.
Interface with_slipped_pairs(const Interface& of, const Equilibrium& equilibrium)
{
  Interface result = sharing(of);
  if (!equilibrium.history || of.friction.common.slipped_pairs_stick) return result;
  constexpr double at_rest = 1e-300; // [m/s] the friction that they slipped with
  for (std::size_t i = 0; i < of.gap.size(); ++i)
  {
    if (!is_undriven(of, i) || equilibrium.history->statuses[i] != ContactStatus::slip) continue;
    const std::span<const double> friction = PairView(equilibrium.reactions, of.directions).tangential(i);
    const std::span<double> drive = TangentView<double>(result.drive, of.directions).of(i);
    for (std::size_t k = 0; k < drive.size(); ++k) drive[k] = at_rest / length(friction) * friction[k];
  }
  return result;
}

} // namespace

LinearisedSliding linearise(const SlidingEquilibrium& sliding)
{
  const auto& [structure, driven, equilibrium] = sliding;
  const Interface interface = with_slipped_pairs(driven, equilibrium);
  LinearisedSliding result;
  result.contact = eliminate_closed_pairs(structure, interface, equilibrium.closed);
  result.C = sliding_damping(sliding); // by the drive
  if (structure.H.get()) result.K = sum_of(structure.K, structure.H);
  if (const auto stiffness = contact_stiffness(interface, equilibrium.closed, PairForces::with_friction);
      stiffness.get())
    result.K = sum_of(result.K.get() ? result.K.get() : structure.K.get(), stiffness);
  result.M_z = project_symmetric(structure.M, result.contact.Z);
  const auto springs = contact_stiffness(interface, equilibrium.closed, PairForces::normal);
  const Owned<Mat> K = springs.get() ? sum_of(structure.K, springs) : Owned<Mat>();
  result.K_z = project_symmetric(K.get() ? K.get() : structure.K.get(), result.contact.Z);
  return result;
}

} // namespace squeal
