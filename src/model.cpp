#include "squeal/model.hpp"

#include "squeal/base/constants.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/mesh/shapes.hpp"
#include "squeal/mesh/ties.hpp"
#include "squeal/solid/matrix_rows.hpp"
#include "squeal/solid/mesh_piece.hpp"
#include "squeal/solid/probes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace squeal
{

namespace
{

/// Says how much of a slave surface does not face its master; nothing where all of it does.
void warn_of_uncovered(const Coverage& c, const std::string& slave, const std::string& master, const char* consequence,
                       std::vector<std::string>& sentences)
{
  constexpr double rounding = 1e-6; // the tolerance of coincident surfaces
  const Vec3& at = c.uncovered_at;
  if (c.covered < (1 - rounding) * c.area)
    sentences.push_back(format("%.3g %% of the area of '%s' does not face '%s', most of it around (%g, %g, %g): %s",
                               100 * (1 - c.covered / c.area), slave.c_str(), master.c_str(), at[0], at[1], at[2],
                               consequence));
}

/// Sentences about elements that are too stiff and slave surfaces that face nothing.
std::vector<std::string> warnings_of(const Model& model, const Scene& scene)
{
  std::vector<std::string> sentences;
  if (!scene.ties.empty())
  {
    const TiedNodes tied = tied_nodes(model.mesh, scene);
    for (std::size_t i = 0; i < scene.ties.size(); ++i)
      warn_of_uncovered(tied.coverage[i], scene.ties[i].slave, scene.ties[i].master, "it is not tied there", sentences);
  }
  if (const long count = std::ranges::count(model.mesh.elements, Shape::tet4, &Element::shape); count > 0)
    sentences.push_back(
        format("%ld 4-node tetrahedra are too stiff: set Mesh.ElementOrder = 2 for 10-node ones", count));
  for (std::size_t i = 0; i < model.coverage.size(); ++i)
  {
    const Contact& contact = scene.contacts[i];
    const bool stator_is_slave = contact.slave == SlaveSide::stator;
    warn_of_uncovered(model.coverage[i], stator_is_slave ? contact.stator : contact.rotor,
                      stator_is_slave ? contact.rotor : contact.stator, "no contact force acts there", sentences);
  }
  return sentences;
}

/// The longest edge of the box round all elements [m]. Points are where the scene puts them, whatever its mesh's unit.
double length_of(const Mesh& mesh)
{
  Vec3 low, high;
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  for (const Element& element : mesh.elements)
    for (const int node : nodes_of(element))
      for (std::size_t c = 0; c < 3; ++c)
      {
        const double x = mesh.nodes[static_cast<std::size_t>(node)][c];
        low[c] = std::min(low[c], x);
        high[c] = std::max(high[c], x);
      }
  return mesh.elements.empty() ? 0 : std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
}

/// C += alpha M + beta K.
void add_damping(Structure& structure, const RayleighDamping& damping)
{
  check(MatAXPY(structure.C, damping.alpha, structure.M, SAME_NONZERO_PATTERN));
  check(MatAXPY(structure.C, damping.beta, structure.K, SAME_NONZERO_PATTERN));
}

/// Takes what supports hold out of the model of a matrix scene.
void hold(Model& model, const Elimination& elimination)
{
  Structure& structure = model.structure;
  for (Owned<Mat>* A : {&structure.M, &structure.C, &structure.K})
  {
    *A = elimination.square(*A);
    mark_symmetric(*A);
  }
  for (Owned<Mat>* A : {&structure.G, &structure.H})
    if (A->get()) *A = elimination.square(*A);
  structure.load = elimination.entries(structure.load);
  model.interface.B = elimination.columns(model.interface.B);
  model.probes = elimination.columns(model.probes);
}

/// Throws Error where a stage cannot take the circulatory part of given matrices.
void check_circulatory_part(const Scene& scene, const Model& model)
{
  const Structure& structure = model.structure;
  if (!structure.H.get()) return;
  const std::string folder = scene.matrices->string();
  if (scene.transient.enabled || scene.cycle.enabled)
    throw Error(folder + ": its circulatory part (H.petsc, or an unsymmetric K.petsc) is for the modes; time steps "
                         "need a symmetric stiffness: take [transient] and [cycle] out");
  double load = 0;
  check(VecNorm(structure.load, NORM_INFINITY, &load));
  if (model.interface.pairs > 0 || load > 0)
    throw Error(folder +
                ": a circulatory part (H.petsc, or an unsymmetric K.petsc) is for modes alone, without contact "
                "pairs and load: take B, gap, drive and F out, or bring friction in by pairs");
}

Model model_of_matrices(const Scene& scene, MPI_Comm comm)
{
  Model model;
  Structure& structure = model.structure;
  structure = read_structure(*scene.matrices, comm);
  model.interface = read_interface(*scene.matrices, structure, scene.friction, comm);
  PetscInt size = 0, local_size = 0;
  check(VecGetSize(structure.load, &size));
  check(VecGetLocalSize(structure.load, &local_size));
  const MatrixRows rows = read_matrix_rows(*scene.matrices, size, comm);
  add_damping(structure, scene.damping);
  add_forces(rows, scene.forces, structure.load);
  model.probes = probe_rows(scene.probes, rows, local_size, comm);
  const auto held = held_rows(rows, scene.supports);
  name_rows(rows, held, structure.names);
  check_circulatory_part(scene, model);
  if (held.empty()) return model;
  hold(model, Elimination(held, structure.load));
  check_interface(model.interface, scene.matrices->string(), comm);
  return model;
}

/// The structure and its contact under another law of friction, of which no matrix depends.
BrakeModel with_friction(const Model& model, const FrictionLaw& friction)
{
  const Structure& own = model.structure;
  const Interface& contact = model.interface;
  BrakeModel result{{},
                    {contact.pairs, contact.directions, copy_of(contact.B), contact.gap, contact.drive,
                     contact.geometry, contact.tangents, contact.compliance, friction}};
  Structure& structure = result.structure;
  for (const auto matrix :
       {&Structure::M, &Structure::C, &Structure::K, &Structure::G, &Structure::H, &Structure::K_loss})
    if ((own.*matrix).get()) structure.*matrix = copy_of((own.*matrix).get());
  for (Mat A : {structure.M.get(), structure.C.get(), structure.K.get(), structure.K_loss.get()})
    if (A) mark_symmetric(A);
  structure.loss_omega = own.loss_omega;
  structure.load = copy_of(own.load);
  structure.elements = own.elements;
  structure.names = own.names;
  check_interface(result.interface, "contact", comm_of(own.load));
  return result;
}

/// On rank 0 the mesh, elsewhere nothing. A signal to the run reaches its mesher as well, which ends by it: the mesh is
/// no error then.
Mesh read_mesh_unless_ended(const Scene& scene, MPI_Comm comm)
{
  Mesh mesh;
  try
  {
    on_rank_zero(comm, [&] { mesh = read_mesh(scene); });
  }
  catch (const Error&)
  {
    end_if_asked(comm);
    throw;
  }
  return mesh;
}

/// `mesh`: on rank 0.
Model model_of_mesh(const Scene& scene, Mesh mesh, MPI_Comm comm)
{
  Model model;
  MeshPiece piece;
  ContactPairs contact;
  piece.mesh = std::move(mesh);
  end_if_asked(comm);
  on_rank_zero(comm, [&] { contact = make_pairs(piece.mesh, scene); });
  broadcast_pairs(contact, comm);
  end_if_asked(comm);
  const auto number = [&]
  {
    piece.partition = partition_mesh(piece.mesh, contact.pairs, ranks_of(comm));
    piece.dofs = number_dofs(piece.mesh, scene, piece.partition, comm);
  };
  on_rank_zero(comm, number);
  distribute(piece, comm);
  end_if_asked(comm);
  model.structure = assemble(piece, scene, comm);
  model.interface = make_interface(contact.pairs, scene, piece.dofs, comm);
  model.coverage = contact.coverage;
  model.probes = probe_rows(scene.probes, piece.mesh, piece.dofs, comm);
  if (rank_of(comm) == 0)
  {
    model.mesh = std::move(piece.mesh);
    model.dofs = std::move(piece.dofs);
  }
  else
    model.dofs.size = piece.dofs.size;
  return model;
}

} // namespace

Model build_model(const Scene& scene, MPI_Comm comm)
{
  Model model =
      scene.matrices ? model_of_matrices(scene, comm) : model_of_mesh(scene, read_mesh_unless_ended(scene, comm), comm);
  if (scene.sweep || scene.robustness) broadcast_mesh(model.mesh, comm); // they make models on groups of ranks
  double mass = 0;
  check(MatNorm(model.structure.M, NORM_1, &mass));
  if (mass == 0 && (scene.modes.enabled || scene.transient.enabled || scene.cycle.enabled))
    throw Error("the structure has no mass, so it has no modes and no motion: give its points masses, or M.petsc "
                "entries; or turn the modes off for the equilibrium alone");
  return model;
}

Model rebuild_model(const Model& model, const Scene& scene, MPI_Comm comm)
{
  if (scene.matrices) return model_of_matrices(scene, comm);
  return model_of_mesh(scene, rank_of(comm) == 0 ? model.mesh : Mesh{}, comm);
}

BrakeModel model_with(const Model& model, const Scene& scene, std::span<const SceneNumber> numbers, MPI_Comm comm)
{
  const Scene other = scene_with(scene, numbers);
  const auto is_friction = [&](const SceneNumber& number)
  { return effect_of_number(scene, number.key) == Effect::friction; };
  int relation = MPI_UNEQUAL;
  MPI_Comm_compare(comm, comm_of(model.structure.load), &relation);
  if (relation == MPI_IDENT && std::ranges::all_of(numbers, is_friction)) return with_friction(model, other.friction);
  Model changed = rebuild_model(model, other, comm);
  return {std::move(changed.structure), std::move(changed.interface)};
}

ModelSummary summary_of(const Model& model, const Scene& scene, MPI_Comm comm)
{
  ModelSummary summary;
  check(MatGetSize(model.structure.K, &summary.dofs, nullptr));
  summary.elements = model.structure.elements;
  summary.pairs = model.interface.pairs;
  summary.coverage = model.coverage;
  summary.ranks = ranks_of(comm);
  const auto look = [&]
  {
    summary.warnings = warnings_of(model, scene);
    summary.length = length_of(model.mesh);
  };
  on_rank_zero(comm, look);
  double stiffness = 0, mass = 0;
  check(MatNorm(model.structure.K, NORM_1, &stiffness));
  check(MatNorm(model.structure.M, NORM_1, &mass));
  if (mass > 0) summary.rounding_hz = 1e-6 * std::sqrt(stiffness / mass) / two_pi;
  return summary;
}

std::vector<double> probe_values(Mat probes, Vec u)
{
  Owned<Vec> values;
  check(MatCreateVecs(probes, nullptr, values.put()));
  check(MatMult(probes, u, values));
  return all_entries(values);
}

} // namespace squeal
