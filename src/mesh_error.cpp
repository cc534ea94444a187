#include "squeal/mesh_error.hpp"

#include "squeal/algebra/shift_invert.hpp"
#include "squeal/base/packed.hpp"
#include "squeal/forecast.hpp"
#include "squeal/modes/passes.hpp"
#include "squeal/reduction/sliding_basis.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// Takes fields of the scene's mesh to the finer one.
class Prolongation
{
public:
  /// Borrows both. Collective.
  Prolongation(const Model& coarse, const Model& fine) : coarse_(coarse), fine_(fine), parents_(fine.mesh.parents)
  {
    broadcast_packed(parents_, comm_of(fine.structure.load));
    int last = -1; // of the elements
    for (const Element& element : fine.mesh.elements)
      for (const int node : element.nodes) last = std::max(last, node);
    file_nodes_ = static_cast<std::size_t>(last) + 1;
  }

  /// Whether the finer mesh divides the same one: a geometry may be meshed otherwise the second time.
  bool is_nested() const
  {
    const std::size_t others = fine_.mesh.nodes.size() - file_nodes_; // points, which follow those of the file
    const auto first = coarse_.mesh.nodes.begin(),
               last = coarse_.mesh.nodes.end() - static_cast<std::ptrdiff_t>(others);
    return std::equal(first, last, fine_.mesh.nodes.begin());
  }

  /// The motion by the shape functions, constraints aside. Collective.
  Owned<Vec> operator()(Vec x) const
  {
    const std::vector<double> q = all_entries(x);
    Owned<Vec> result = zeros_like(fine_.structure.load);
    const DofMap& dofs = fine_.dofs;
    const auto [first, last] = own_range(result);
    for (PetscInt i = first; i < last; ++i)
    {
      const PetscInt nodal = dofs.names.nodal_dof[static_cast<std::size_t>(i)];
      const double value = sum_over_parents(static_cast<std::size_t>(nodal / 6), [&](std::size_t parent)
                                            { return coarse(parent, static_cast<int>(nodal % 6), q); });
      check(VecSetValue(result, i, value, INSERT_VALUES));
    }
    finish(result);
    return result;
  }

  /// The pairs of the finer mesh that the scene's mesh has closed: of new nodes, where all they come from are.
  std::vector<char> closed_pairs(const Equilibrium& equilibrium) const
  {
    std::vector<double> open(coarse_.mesh.nodes.size(), std::nan("")); // else 0
    for (std::size_t i = 0; i < equilibrium.closed.size(); ++i)
      if (equilibrium.closed[i]) open[static_cast<std::size_t>(coarse_.interface.geometry[i].node)] = 0;
    std::vector<char> result;
    for (const ContactPair& pair : fine_.interface.geometry)
      result.push_back(!std::isnan(
          sum_over_parents(static_cast<std::size_t>(pair.node), [&](std::size_t node) { return open[node]; })));
    return result;
  }

private:
  /// A value at a node of the finer mesh from those at nodes of the scene's.
  double sum_over_parents(std::size_t node, const auto& value) const
  {
    const std::size_t kept = file_nodes_ - parents_.size();
    if (node < kept) return value(node);
    if (node >= file_nodes_) return value(node - parents_.size());
    double sum = 0;
    for (const auto& [parent, weight] : parents_[node - kept]) sum += weight * value(static_cast<std::size_t>(parent));
    return sum;
  }

  double coarse(std::size_t node, int c, const std::vector<double>& q) const
  {
    double sum = 0;
    for (const auto& [dof, factor] : coarse_.dofs.terms_of(6 * static_cast<PetscInt>(node) + c))
      sum += factor * q[static_cast<std::size_t>(dof)];
    return sum;
  }

  const Model &coarse_, &fine_;
  std::vector<NodeWeights> parents_;
  std::size_t file_nodes_ = 0; // of the finer mesh
};

MeshError skipped(const std::string& reason)
{
  MeshError result;
  result.outcome = {OutcomeKind::skipped, reason, 0, 0};
  return result;
}

/// An eigenvalue [1/s] and its backward error; infinite: there is none.
using Found = std::pair<std::complex<double>, double>;

/// Finds the eigenvalue of the mode most like each one on the finer mesh with these closed pairs.
std::vector<Found> find_finer(std::span<const ComplexMode* const> modes, const Prolongation& prolong,
                              const SlidingEquilibrium& sliding, const PencilOptions& options)
{
  constexpr double beside = 1e-4, lowest = 0.5, highest = 1.4; // of the frequency
  constexpr int passes = 30;
  constexpr std::size_t pairs = 6; // whichever of them friction mixes
  const LinearisedSliding linearised = linearise(sliding);
  const QuadraticProblem problem = sliding_problem(sliding.structure, linearised);
  const Owned<Mat> K_loss = sliding_loss(sliding.structure, linearised);
  ShiftInvert pencil = make_shift_invert(linearised.K_z, linearised.M_z, Keep::factor, options);
  std::vector<Found> result(modes.size(), {{}, HUGE_VAL});
  for (std::size_t k = 0; k < modes.size(); ++k)
  {
    const Owned<Vec> real = prolong(modes[k]->real), imaginary = prolong(modes[k]->imaginary);
    const std::array parts{real.get(), imaginary.get()};
    const MultiVector start = kept_rows(columns_of(parts), linearised.contact);
    const double square = std::norm(modes[k]->lambda);
    move_to(pencil, (1 + beside) * square);
    // a step of inverse iteration: a prolongation is stiff where the coarse elements were not
    const QuadraticSolution found =
        solve_on_subspace(problem, K_loss, pencil.factor->solve(product(linearised.M_z, start)), pencil.factor.get(),
                          {.window = {lowest * lowest * square, highest * highest * square},
                           .passes = passes,
                           .pairs = pairs,
                           .tolerance = 1e-12,
                           .sharp = 1e-13});
    double best = 0;
    for (const Eigenpair& pair : found.pairs)
    {
      const std::array vector{pair.real.get(), pair.imaginary.get()};
      const Eigen::MatrixXd products = inner_products(columns_of(vector), start);
      const double like = std::hypot(products(0, 0) + products(1, 1), products(0, 1) - products(1, 0));
      if (!(like > best) || !(pair.backward_error < 1e-8)) continue;
      best = like;
      result[k] = {pair.lambda, pair.backward_error};
    }
  }
  return result;
}

/// The modes that grow, then stable ones of least damping ratio: a finer mesh turns the sign of these first.
std::vector<const ComplexMode*> modes_at_stake(const Modes& found)
{
  constexpr std::ptrdiff_t stable = 2;
  std::vector<const ComplexMode*> modes;
  for (const ComplexMode& mode : found.modes)
    if (mode.frequency_hz() != 0) modes.push_back(&mode);
  std::ranges::stable_sort(modes, {}, [](const ComplexMode* mode) { return std::max(mode->damping_ratio(), 0.); });
  const auto growing = std::ranges::count_if(modes, [](const ComplexMode* mode) { return mode->growth_rate() > 0; });
  modes.resize(std::min(modes.size(), static_cast<std::size_t>(growing + stable)));
  return modes;
}

MeshError on_finer_model(const SlidingPoint& point, const Model& fine, const ProgramOptions& options)
{
  MeshError result;
  result.dofs = entry_count(fine.structure.load);
  result.outcome = {OutcomeKind::not_converged, "no equilibrium was found on the finer mesh", 0, 0};
  const StageRunner within = [](Stage, const std::function<bool()>& work) { return work(), std::string{}; };
  Equilibrium equilibrium = std::move(find_sliding(fine, options, within).equilibrium);
  if (equilibrium.outcome.kind != OutcomeKind::converged) return result;
  const Prolongation prolong(*point.model, fine);
  if (!prolong.is_nested()) return skipped("gmsh made another mesh of the geometry the second time");
  result.outcome = {OutcomeKind::converged, "", 0, 0};
  const std::vector<const ComplexMode*> modes = modes_at_stake(point.modes);
  const SlidingEquilibrium sliding{fine.structure, fine.interface, equilibrium};
  const std::vector<Found> own = find_finer(modes, prolong, sliding, options.modes.pencil);

  std::vector<Found> held = own;
  if (const std::vector<char> closed = prolong.closed_pairs(point.equilibrium); closed != equilibrium.closed)
  {
    equilibrium.closed = closed;
    held = find_finer(modes, prolong, sliding, options.modes.pencil);
  }
  for (std::size_t k = 0; k < modes.size(); ++k)
    if (std::isinf(own[k].second) || std::isinf(held[k].second))
      result.outcome = {OutcomeKind::not_converged, "a mode was not found on the finer mesh", 0, 0};
    else
      result.modes.push_back({modes[k]->lambda, own[k].first, held[k].first, own[k].second});
  return result;
}

} // namespace

MeshError find_mesh_error(const SlidingPoint& point, const Scene& scene, const ProgramOptions& options)
{
  if (!scene.mesh) return skipped("the scene has no mesh that could be divided");
  if (point.modes.modes.empty()) return skipped("no mode was found in the band");
  Scene finer = scene;
  ++finer.mesh->refine;
  finer.transient.enabled = finer.cycle.enabled = false;
  finer.response.reset();
  finer.sweep.reset();
  finer.robustness.reset();
  const MPI_Comm comm = comm_of(point.model->structure.load);
  const Model fine = build_model(finer, comm);
  const std::string problem = problem_of(forecast_of(fine, finer, options), comm);
  return problem.empty() ? on_finer_model(point, fine, options) : skipped("on the finer mesh " + problem);
}

} // namespace squeal
