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
  for (Owned<Mat>* A : {&structure.M, &structure.C, &structure.K})
  {
    *A = elimination.square(*A);
    mark_symmetric(*A);
  }
  for (Owned<Mat>* A : {&structure.G, &structure.H})
    if (A->get()) *A = elimination.square(*A);
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
  model.probes = probe_rows(scene.probes, rows, local_size, comm);
  const auto held = held_rows(rows, scene.supports);
  name_rows(rows, held, structure.names);
  check_circulatory_part(scene, model);
  if (held.empty()) return model;
  hold(model, Elimination(held, structure.load));
  check_interface(model.interface, scene.matrices->string(), comm);
  return model;
}

/// Structure and contact that share all matrices with these.
BrakeModel sharing(const Structure& own, const Interface& contact)
{
  BrakeModel result{{}, sharing(contact)};
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
  double mass = 0;
  check(MatNorm(model.structure.M, NORM_1, &mass));
  if (mass == 0 && (scene.modes.enabled || scene.transient.enabled || scene.cycle.enabled))
    throw Error("the structure has no mass, so it has no modes and no motion: give its points masses, or M.petsc "
                "entries; or turn the modes off for the equilibrium alone");
  return model;
}

NearbyModels::NearbyModels(const Model& model, const Scene& scene)
    : model_(model), scene_(scene),
      comm_(comm_of(model.structure.load)), own_{sharing(model.structure, model.interface), Values{}}
{
}

std::set<Effect> NearbyModels::changes(const Known& known, const Values& values) const
{
  if (!known.values) return {Effect::mesh};
  std::set<Effect> changed;
  // A number that does not say what it changes may change everything.
  const auto effect_of = [&](const std::string& key)
  {
    const Effect effect = description_of(scene_, key).effect;
    return effect == Effect::nothing ? Effect::mesh : effect;
  };
  const auto compare = [&](const Values& these, const Values& others)
  {
    for (const auto& [key, value] : these)
      if (const auto other = others.find(key); other == others.end() || other->second != value)
        changed.insert(effect_of(key));
  };
  compare(values, *known.values);
  compare(*known.values, values);
  return changed;
}

const NumberedMesh& NearbyModels::numbered(const Scene& scene)
{
  if (numbered_) return *numbered_;
  numbered_ = number_mesh(scene, with_points(model_.mesh, scene), pairs_, comm_);
  ++made_.mesh;
  return *numbered_;
}

BrakeModel NearbyModels::made_from_files(const Scene& scene)
{
  last_.model = {};
  Model model = model_of_matrices(scene, comm_);
  ++made_.matrices;
  ++made_.load;
  ++made_.contact;
  return {std::move(model.structure), std::move(model.interface)};
}

BrakeModel NearbyModels::made_of_mesh(const Scene& scene, const std::set<Effect>& from_own,
                                      const std::set<Effect>& from_last)
{
  const auto serves = [](const std::set<Effect>& changed, std::initializer_list<Effect> effects)
  { return std::ranges::none_of(effects, [&](Effect effect) { return changed.contains(effect); }); };
  // The model at hand whose part no change enters; null: the part is to be made.
  const auto at_hand = [&](std::initializer_list<Effect> effects) -> const BrakeModel*
  {
    if (serves(from_own, effects)) return &own_.model;
    return serves(from_last, effects) ? &last_.model : nullptr;
  };
  const BrakeModel *const mass_of = at_hand({Effect::mesh, Effect::stiffness_and_mass, Effect::mass}),
                          *const stiffness_of = at_hand({Effect::mesh, Effect::stiffness_and_mass}),
                          *const loss_of = at_hand({Effect::mesh, Effect::stiffness_and_mass, Effect::damping}),
                          *const damping_of =
                              at_hand({Effect::mesh, Effect::stiffness_and_mass, Effect::mass, Effect::damping}),
                          *const load_of = has_preload(scene) ? nullptr : at_hand({Effect::mesh, Effect::load}),
                          *const rows_of = at_hand({Effect::mesh, Effect::drive}),
                          *const contact_of = at_hand({Effect::mesh, Effect::drive, Effect::gap});
  BrakeModel next;
  if (damping_of)
    next = sharing(damping_of->structure, {});
  else
  {
    for (const auto& [of, matrix] : {std::pair{mass_of, &Structure::M}, {stiffness_of, &Structure::K}})
      if (!of) last_.model.structure.*matrix = {}; // not beside the new one
    last_.model.structure.C = {};
    next.structure = assemble(numbered(scene), scene, comm_);
    ++made_.matrices;
  }
  Structure& structure = next.structure;
  if (mass_of) structure.M = shared(mass_of->structure.M.get());
  if (stiffness_of) structure.K = shared(stiffness_of->structure.K.get());
  if (stiffness_of) structure.G = shared(stiffness_of->structure.G.get());
  if (loss_of) structure.K_loss = shared(loss_of->structure.K_loss.get());
  if (load_of)
    share_loads(load_of->structure, structure);
  else
  {
    structure.load = assemble_load(numbered(scene).mesh, scene, numbered(scene).dofs, comm_);
    assemble_preload(structure, numbered(scene), scene, comm_);
    structure.path = path_of_mesh(structure, scene, numbered(scene), comm_);
    ++made_.load;
  }
  if (contact_of)
    next.interface = sharing({}, contact_of->interface).interface;
  else
  {
    const NumberedMesh& mesh = numbered(scene);
    next.interface = make_interface(pairs_.pairs, scene, mesh.dofs, comm_);
    ++made_.contact;
    if (rows_of) next.interface.B = shared(rows_of->interface.B.get());
  }
  return next;
}

BrakeModel NearbyModels::at(std::span<const SceneNumber> numbers)
{
  const Scene scene = scene_with(scene_, numbers);
  Values values;
  for (const auto& [key, value] : driven_by(scene_, numbers)) values[key] = value;
  const std::set<Effect> from_own = changes(own_, values), from_last = changes(last_, values);
  last_.values.reset(); // until the next model is made
  if (from_last.contains(Effect::mesh)) numbered_.reset();
  const auto is_friction = [](Effect effect) { return effect == Effect::friction; };
  if (!scene.matrices)
    last_.model = made_of_mesh(scene, from_own, from_last);
  else if (std::ranges::all_of(from_own, is_friction))
    last_.model = sharing(own_.model.structure, own_.model.interface);
  else if (!std::ranges::all_of(from_last, is_friction))
    last_.model = made_from_files(scene);
  Interface& interface = last_.model.interface;
  interface.friction = friction_of_pairs(scene, interface.geometry);
  check_interface(interface, "contact", comm_);
  tighten(last_.model.structure, interface);
  last_.values = std::move(values);
  return sharing(last_.model.structure, interface);
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
  Owned<Vec> values;
  check(MatCreateVecs(probes, nullptr, values.put()));
  check(MatMult(probes, u, values));
  return all_entries(values);
}

} // namespace squeal
