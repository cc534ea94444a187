#include "squeal/model.hpp"

#include "squeal/base/constants.hpp"
#include "squeal/base/petsc.hpp"
#include "squeal/base/run_control.hpp"
#include "squeal/equilibrium/equilibrium.hpp"
#include "squeal/mesh/contact_pairs.hpp"
#include "squeal/mesh/shape_functions.hpp"
#include "squeal/solid/binary.hpp"
#include "squeal/solid/structure.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

namespace squeal
{

namespace
{

/// The places of the bolts that a step tightens.
std::vector<std::size_t> bolts_of(const LoadStep& step, const Scene& scene)
{
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < scene.bolts.size(); ++i)
    if (std::ranges::count(step.bolts, scene.bolts[i].name) > 0) places.push_back(i);
  return places;
}

/// A path that shares its loads with this one.
std::vector<PathStep> sharing(const std::vector<PathStep>& path)
{
  std::vector<PathStep> result;
  for (const PathStep& step : path)
    result.push_back({step.name, shared(step.load.get()), step.driven_friction, step.bolts});
  return result;
}

/// The load of a step on q, of a scene whose forces and pressures have its factors.
using LoadOf = std::function<Owned<Vec>(const Scene& loaded, const LoadStep& step)>;

/// The path by the scene's steps, of which the last has this load. Collective.
std::vector<PathStep> path_to(Vec load, const Scene& scene, const LoadOf& load_of)
{
  std::vector<PathStep> path;
  for (const LoadStep& step : scene.steps)
  {
    Scene loaded = scene;
    for (std::size_t i = 0; i < loaded.forces.size(); ++i)
    {
      const double factor = step.load * (step.forces.empty() ? 1 : step.forces[i]);
      loaded.forces[i].vector = factor * loaded.forces[i].vector;
      loaded.forces[i].moment = factor * loaded.forces[i].moment;
    }
    for (std::size_t i = 0; i < loaded.pressures.size(); ++i)
      loaded.pressures[i].value *= step.load * (step.pressures.empty() ? 1 : step.pressures[i]);
    const bool is_last = &step == &scene.steps.back();
    path.push_back({step.name, is_last ? shared(load) : load_of(loaded, step), step.friction, bolts_of(step, scene)});
  }
  return path;
}

/// The path on a mesh. Where no step names bolts, a first one tightens all of them. Collective.
std::vector<PathStep> path_of_mesh(const Structure& structure, const Scene& scene, const NumberedMesh& numbered,
                                   MPI_Comm comm)
{
  Scene stepped = scene;
  const auto tightens = [](const LoadStep& step) { return !step.bolts.empty(); };
  if (!scene.bolts.empty() && std::ranges::none_of(scene.steps, tightens))
  {
    LoadStep first{"bolts", 0, {}, {}};
    for (const Bolt& bolt : scene.bolts) first.bolts.push_back(bolt.name);
    if (stepped.steps.empty()) stepped.steps.push_back({"load", 1, {}, {}});
    first.friction = stepped.steps.front().friction;
    stepped.steps.insert(stepped.steps.begin(), first);
  }
  return path_to(structure.load, stepped,
                 [&](const Scene& loaded, const LoadStep&)
                 {
                   Owned<Vec> load = assemble_load(numbered.mesh, loaded, numbered.dofs, comm);
                   if (structure.preload.get()) check(VecAXPY(load, 1, structure.preload));
                   return load;
                 });
}

/// Lets a structure have these loads, bolts and path.
void share_loads(const Structure& own, Structure& structure)
{
  structure.load = shared(own.load.get());
  structure.preload = shared(own.preload.get());
  structure.bolts.clear();
  for (const TightBolt& bolt : own.bolts)
    structure.bolts.push_back(
        {bolt.name, bolt.tension, shared(bolt.pull.get()), bolt.stiffness, bolt.own, bolt.shortening});
  structure.path = sharing(own.path);
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
  for (Owned<Mat>* A : {&structure.M, &structure.C, &structure.K, &structure.G, &structure.H})
    *A = elimination.square(*A);
  for (const Mat A : {structure.M.get(), structure.C.get(), structure.K.get()}) mark_symmetric(A);
  structure.load = elimination.entries(structure.load);
  for (PathStep& step : structure.path) step.load = elimination.entries(step.load);
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
  if (model.interface.pairs > 0 || norm_of(structure.load, NORM_INFINITY) > 0)
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
  const MatrixRows rows = read_matrix_rows(*scene.matrices, entry_count(structure.load), comm);
  add_damping(structure, scene.damping);
  const Owned<Vec> given = copy_of(structure.load.get());
  add_forces(rows, scene.forces, structure.load);
  structure.path = path_to(structure.load, scene,
                           [&](const Scene& loaded, const LoadStep& step)
                           {
                             Owned<Vec> load = copy_of(given.get());
                             check(VecScale(load, step.load));
                             add_forces(rows, loaded.forces, load);
                             return load;
                           });
  model.probes = probe_rows(scene.probes, rows, own_range(structure.load).size(), comm);
  const auto held = held_rows(rows, scene.supports);
  name_rows(rows, held, structure.names);
  check_circulatory_part(scene, model);
  if (held.empty()) return model;
  hold(model, Elimination(held, structure.load));
  check_interface(model.interface, scene.matrices->string(), comm);
  return model;
}

/// Structure and contact that share all matrices with these.
Model sharing(const Structure& own, const Interface& contact)
{
  Model result;
  result.interface = sharing(contact);
  Structure& structure = result.structure;
  for (const auto matrix :
       {&Structure::M, &Structure::C, &Structure::K, &Structure::G, &Structure::H, &Structure::K_loss})
    structure.*matrix = shared((own.*matrix).get());
  structure.loss_omega = own.loss_omega;
  share_loads(own, structure);
  structure.elements = own.elements;
  structure.names = own.names;
  return result;
}

/// The mesh, on every rank. A signal to the run reaches its mesher as well, which ends by it: the mesh is no error
/// then.
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
  broadcast_mesh(mesh, comm);
  return mesh;
}

/// Finds the pairs of a mesh and numbers its degrees of freedom, alike on every rank.
NumberedMesh number_mesh(const Scene& scene, Mesh mesh, ContactPairs& contact, MPI_Comm comm)
{
  NumberedMesh numbered{std::move(mesh)};
  end_if_asked(comm);
  on_every_rank(comm, [&] { contact = make_pairs(numbered.mesh, scene); });
  end_if_asked(comm);
  const auto part_and_number = [&]
  {
    numbered.partition = partition_mesh(numbered.mesh, contact.pairs, ranks_of(comm));
    numbered.dofs = number_dofs(numbered.mesh, scene, numbered.partition, comm);
  };
  on_every_rank(comm, part_and_number);
  end_if_asked(comm);
  return numbered;
}

Model model_of_mesh(Scene& scene, Mesh mesh, MPI_Comm comm)
{
  Model model;
  std::vector<int> rotors;
  on_every_rank(comm, [&] { rotors = rotors_of_contacts(scene, mesh); });
  if (!scene.rotors.empty()) drive_contacts(scene, rotors);
  ContactPairs contact;
  NumberedMesh numbered = number_mesh(scene, std::move(mesh), contact, comm);
  model.structure = assemble(numbered, scene, comm);
  model.structure.path = path_of_mesh(model.structure, scene, numbered, comm);
  model.interface = make_interface(contact.pairs, scene, numbered.dofs, comm);
  tighten(model.structure, model.interface);
  model.coverage = contact.coverage;
  model.probes = probe_rows(scene.probes, numbered.mesh, numbered.dofs, comm);
  model.mesh = std::move(numbered.mesh);
  model.dofs = std::move(numbered.dofs);
  return model;
}

/// The mesh with points and reference points where the scene has them.
Mesh with_points(Mesh mesh, const Scene& scene)
{
  place_points(scene, mesh);
  return mesh;
}

} // namespace

Model build_model(Scene& scene, MPI_Comm comm)
{
  Model model =
      scene.matrices ? model_of_matrices(scene, comm) : model_of_mesh(scene, read_mesh_unless_ended(scene, comm), comm);
  if (norm_of(model.structure.M, NORM_1) == 0 &&
      (scene.modes.enabled || scene.transient.enabled || scene.cycle.enabled))
    throw Error("the structure has no mass, so it has no modes and no motion: give its points masses, or M.petsc "
                "entries; or turn the modes off for the equilibrium alone");
  return model;
}

NearbyModels::NearbyModels(const Model& model, const Scene& scene)
    : model_(model), scene_(scene), comm_(comm_of(model.structure.load))
{
}

const NumberedMesh& NearbyModels::numbered(const Scene& scene)
{
  if (!numbered_) numbered_ = number_mesh(scene, with_points(model_.mesh, scene), pairs_, comm_);
  return *numbered_;
}

Model NearbyModels::made_of_mesh(const Scene& scene, const std::set<Effect>& changed)
{
  const bool moved = changed.contains(Effect::mesh);
  const auto stays = [&](std::initializer_list<Effect> effects)
  { return !moved && std::ranges::none_of(effects, [&](Effect effect) { return changed.contains(effect); }); };
  const bool keeps_stiffness = stays({Effect::stiffness_and_mass}), keeps_rows = stays({Effect::drive});
  if (moved) numbered_.reset();
  const Structure& own = model_.structure;
  Model next = sharing(own, model_.interface);
  Structure& structure = next.structure;
  if (!keeps_stiffness || !stays({Effect::mass, Effect::damping}))
  {
    structure = assemble(numbered(scene), scene, comm_);
    if (keeps_stiffness && stays({Effect::mass})) structure.M = shared(own.M.get());
    if (keeps_stiffness) structure.K = shared(own.K.get());
    if (keeps_stiffness) structure.G = shared(own.G.get());
    if (keeps_stiffness && stays({Effect::damping})) structure.K_loss = shared(own.K_loss.get());
  }
  if (!has_preload(scene) && stays({Effect::load}))
    share_loads(own, structure);
  else
  {
    structure.load = assemble_load(numbered(scene).mesh, scene, numbered(scene).dofs, comm_);
    assemble_preload(structure, numbered(scene), scene, comm_);
    structure.path = path_of_mesh(structure, scene, numbered(scene), comm_);
  }
  if (!keeps_rows || !stays({Effect::gap}))
  {
    const NumberedMesh& mesh = numbered(scene);
    next.interface = make_interface(pairs_.pairs, scene, mesh.dofs, comm_);
    if (keeps_rows) next.interface.B = shared(model_.interface.B.get());
  }
  if (moved) numbered_.reset();
  return next;
}

Model NearbyModels::at(std::span<const SceneNumber> numbers)
{
  const Scene scene = scene_with(scene_, numbers);
  std::set<Effect> changed;
  for (const SceneNumber& number : driven_by(scene_, numbers))
  {
    const Effect effect = description_of(scene_, number.key).effect;
    changed.insert(effect == Effect::nothing ? Effect::mesh : effect); // what it does not say may be everything
  }
  Model model;
  if (!scene.matrices)
    model = made_of_mesh(scene, changed);
  else if (std::ranges::all_of(changed, [](Effect effect) { return effect == Effect::friction; }))
    model = sharing(model_.structure, model_.interface);
  else
    model = model_of_matrices(scene, comm_);
  model.interface.friction = friction_of_pairs(scene, model.interface.geometry);
  check_interface(model.interface, "contact", comm_);
  tighten(model.structure, model.interface);
  return model;
}

void add_shifts(const Scene& scene, const Model& model, std::vector<double>& values)
{
  if (model.dofs.shift.empty()) return;
  const std::vector<int> nodes = probed_nodes(scene.probes, model.mesh);
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c)
      values[i] += scene.probes[i].direction[c] * model.dofs.shift_of(6 * PetscInt{nodes[i]} + static_cast<int>(c));
}

std::vector<double> probe_values(Mat probes, Vec u)
{
  return all_entries(product(probes, u));
}

} // namespace squeal
