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
    PetscInt first = 0, last = 0;
    check(VecGetOwnershipRange(result, &first, &last));
    for (PetscInt i = first; i < last; ++i)
    {
      const PetscInt nodal = dofs.names.nodal_dof[static_cast<std::size_t>(i)];
      check(VecSetValue(result, i, at(static_cast<std::size_t>(nodal / 6), static_cast<int>(nodal % 6), q),
                        INSERT_VALUES));
    }
    check(VecAssemblyBegin(result));
    check(VecAssemblyEnd(result));
    return result;
  }

private:
  /// Component c of a node of the finer mesh.
  double at(std::size_t node, int c, const std::vector<double>& q) const
  {
    const std::size_t kept = file_nodes_ - parents_.size();
    if (node < kept) return coarse(node, c, q);
    if (node >= file_nodes_) return coarse(node - parents_.size(), c, q);
    double sum = 0;
    for (const auto& [parent, weight] : parents_[node - kept])
      sum += weight * coarse(static_cast<std::size_t>(parent), c, q);
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

/// A part of the finer problem.
struct FinerProblem
{
  QuadraticProblem matrices;
  Owned<Mat> K_loss;
  ShiftInvert pencil;
};

/// The mode that is most like `start`, real and imaginary part, near lambda.
ModeOnFinerMesh find_finer(FinerProblem& problem, std::complex<double> lambda, const MultiVector& start)
{
  constexpr double beside = 1e-4, lowest = 0.7, highest = 1.4; // of the frequency
  constexpr int passes = 30;
  constexpr std::size_t pairs = 6; // whichever of them friction mixes
  const double square = std::norm(lambda);
  move_to(problem.pencil, (1 + beside) * square);
  const QuadraticSolution found =
      solve_on_subspace(problem.matrices, problem.K_loss, start, problem.pencil.factor.get(),
                        {.window = {lowest * lowest * square, highest * highest * square},
                         .passes = passes,
                         .pairs = pairs,
                         .tolerance = 1e-12,
                         .sharp = 1e-13});
  ModeOnFinerMesh result{lambda, {}, std::nan("")};
  double best = 0;
  for (const Eigenpair& pair : found.pairs)
  {
    const std::array parts{pair.real.get(), pair.imaginary.get()};
    const Eigen::MatrixXd products = inner_products(columns_of(parts), start);
    const double like = std::hypot(products(0, 0) + products(1, 1), products(0, 1) - products(1, 0));
    if (!(like > best) || !(pair.backward_error < 1e-8)) continue;
    best = like;
    result.finer = pair.lambda;
    result.backward_error = pair.backward_error;
  }
  return result;
}

MeshError skipped(const std::string& reason)
{
  MeshError result;
  result.outcome = {OutcomeKind::skipped, reason, 0, 0};
  return result;
}

MeshError on_finer_model(const SlidingPoint& point, const Model& fine, const ProgramOptions& options)
{
  MeshError result;
  check(VecGetSize(fine.structure.load, &result.dofs));
  result.outcome = {OutcomeKind::not_converged, "no equilibrium was found on the finer mesh", 0, 0};
  const Equilibrium equilibrium = find_equilibrium(fine.structure, fine.interface, options.equilibrium);
  if (equilibrium.outcome.kind != OutcomeKind::converged) return result;
  const LinearisedSliding linearised = linearise({fine.structure, fine.interface, equilibrium});
  const ClosedContact& contact = linearised.contact;
  FinerProblem problem{sliding_problem(fine.structure, linearised), sliding_loss(fine.structure, linearised),
                       make_shift_invert(linearised.K_z, linearised.M_z, Keep::factor, options.modes.pencil)};
  const Prolongation prolong(*point.model, fine);
  if (!prolong.is_nested()) return skipped("gmsh made another mesh of the geometry the second time");
  result.outcome = {OutcomeKind::converged, "", 0, 0};
  const auto asked = std::min(point.modes.modes.size(), static_cast<std::size_t>(point.modes.unstable_count) + 1);
  for (const ComplexMode& mode : std::span(point.modes.modes).first(asked))
  {
    if (mode.frequency_hz() == 0) continue;
    const Owned<Vec> real = prolong(mode.real), imaginary = prolong(mode.imaginary);
    const std::array parts{real.get(), imaginary.get()};
    result.modes.push_back(find_finer(problem, mode.lambda, kept_rows(columns_of(parts), contact)));
    const double error = result.modes.back().backward_error;
    result.outcome.residual = std::max(result.outcome.residual, error);
    if (!result.modes.back().is_known())
      result.outcome = {OutcomeKind::not_converged, "a mode was not found on the finer mesh", 0, 0};
  }
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
