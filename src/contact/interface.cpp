#include "squeal/contact/interface.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/base/error.hpp"
#include "squeal/solid/binary.hpp"
#include "squeal/solid/structure.hpp"

#include <algorithm>
#include <cmath>

namespace squeal
{

namespace
{

/// The part of `v` in the tangent plane; zero when only round-off of the normal part is left.
Vec3 tangential(const Vec3& v, const Vec3& normal)
{
  const Vec3 t = v - dot(v, normal) * normal;
  return norm(t) > 1e-12 * norm(v) ? t : Vec3{};
}

/// The scene's tangents made unit and square to the normal. Without them the first is along the drive, the second
/// square to it. Without a drive it is along the axis that is farthest from the normal.
std::vector<Vec3> tangent_axes(const Contact& contact, const Vec3& normal, const Vec3& velocity)
{
  std::vector<Vec3> wanted = contact.tangents;
  if (wanted.empty() && norm(velocity) > 0) wanted.push_back(velocity);
  if (wanted.empty())
  {
    const auto along = [&](std::size_t axis) { return std::abs(normal[axis]); };
    Vec3 axis{};
    axis[along(0) <= along(1) && along(0) <= along(2) ? 0 : along(1) <= along(2) ? 1 : 2] = 1;
    wanted.push_back(axis);
  }
  const Vec3 t = tangential(wanted[0], normal);
  if (norm(t) == 0)
    throw Error("contact of " + contact.rotor + " and " + contact.stator + ": its first tangent is along the normal");
  std::vector<Vec3> axes{(1 / norm(t)) * t};
  if (contact.tangents.size() == 1) return axes;
  const Vec3 second = cross(normal, axes[0]);
  const bool reversed = wanted.size() > 1 && dot(wanted[1], second) < 0;
  axes.push_back((reversed ? -1. : 1.) * second);
  return axes;
}

/// Reads the compliance of each pair, if the file is there.
void read_compliance(const std::filesystem::path& file, Interface& interface, MPI_Comm comm)
{
  if (!is_there(file, comm)) return;
  interface.compliance = read_vector(file, comm);
  if (interface.compliance.size() != interface.gap.size())
    throw Error(file.string() + ": length " + std::to_string(interface.compliance.size()) + " for the " +
                std::to_string(interface.pairs) + " pairs of gap.petsc; give each pair its m/N, 0 where it is rigid");
  for (std::size_t i = 0; i < interface.compliance.size(); ++i)
    if (!(interface.compliance[i] >= 0))
      throw Error(file.string() + ": entry " + std::to_string(i) + " is " + std::to_string(interface.compliance[i]) +
                  "; a compliance must not be negative");
}

} // namespace

Vec3 drive_velocity(const Contact& contact, const Vec3& at)
{
  if (!contact.rotation) return contact.velocity;
  const Rotation& rotation = *contact.rotation;
  const Vec3 arm = cross(rotation.axis, at - rotation.centre);
  return norm(arm) > 1e-12 * (norm(at) + norm(rotation.centre)) ? rotation.rate * arm : Vec3{};
}

void check_interface(const Interface& interface, const std::string& source, MPI_Comm comm)
{
  std::string problem;
  const auto is_zero = [](double value) { return value == 0; };
  const PairRows<PetscInt> rows(interface.directions);
  for_each_row(interface.B,
               [&](PetscInt row, std::span<const PetscInt>, std::span<const PetscScalar> values)
               {
                 if (!rows.is_normal(row) || !problem.empty()) return;
                 if (std::all_of(values.begin(), values.end(), is_zero))
                   problem = source + ": " + place_of_pair(interface, static_cast<std::size_t>(rows.pair_of(row))) +
                             " cannot move along its normal: both sides are held still there, remove it from the "
                             "contact";
               });
  agree(comm, problem);
}

std::string place_of_pair(const Interface& interface, std::size_t pair)
{
  if (interface.geometry.empty()) return format("pair %zu", pair);
  const ContactPair& at = interface.geometry[pair];
  return format("pair %zu of contact %d at (%g, %g, %g)", pair, at.contact, at.position[0], at.position[1],
                at.position[2]);
}

Interface sharing(const Interface& of)
{
  return {of.pairs,    of.directions, shared(of.B.get()), of.gap,     of.drive, of.geometry,
          of.tangents, of.compliance, of.slip_compliance, of.friction};
}

namespace
{

/// Adds to the gaps what supports move the pairs' nodes by. Collective; rank 0 knows it. Throws Error where they move
/// an undriven pair along its surfaces, which is a slip on the way that no step states.
void add_shifts(Interface& interface, const Scene& scene, const DofMap& dofs, MPI_Comm comm)
{
  const auto add_all = [&]
  {
    for (std::size_t i = 0; i < interface.geometry.size() && !dofs.shift.empty(); ++i)
    {
      const ContactPair& pair = interface.geometry[i];
      Vec3 moved{};
      for (const auto& [node, weight] : pair.nodes)
        for (int c = 0; c < 3; ++c)
          moved[static_cast<std::size_t>(c)] += weight * dofs.shift_of(6 * PetscInt{node} + c);
      interface.gap[i] += dot(pair.normal, moved);
      const Contact& contact = scene.contacts[static_cast<std::size_t>(pair.contact)];
      if (is_undriven(contact) && norm(tangential(moved, pair.normal)) > 0)
        throw Error("contact of '" + contact.rotor + "' and '" + contact.stator +
                    "': a support moves its nodes along the surface: let it move a body that springs or elements "
                    "join to them");
    }
  };
  on_rank_zero(comm, add_all);
  broadcast(interface.gap, comm);
}

} // namespace

Interface make_interface(const std::vector<ContactPair>& pairs, const Scene& scene, const DofMap& dofs, MPI_Comm comm)
{
  Interface interface;
  interface.pairs = static_cast<int>(pairs.size());
  interface.friction = friction_of_pairs(scene, pairs);
  interface.directions = 1;
  bool compliant = false, elastic = false;
  for (const Contact& contact : scene.contacts)
  {
    if (contact.tangents.size() != 1) interface.directions = 2;
    compliant = compliant || contact.compliance > 0;
    elastic = elastic || contact.slip_compliance > 0;
  }
  std::vector<SparseRow> rows; // of this rank's pairs
  const auto [first, last] = local_range(interface.pairs, comm);
  for (const ContactPair& pair : pairs)
  {
    const Contact& contact = scene.contacts[static_cast<std::size_t>(pair.contact)];
    const Vec3& at = pair.position;
    const Vec3 velocity = tangential(drive_velocity(contact, at), pair.normal);
    std::vector<Vec3> axes = tangent_axes(contact, pair.normal, velocity);
    axes.resize(static_cast<std::size_t>(interface.directions)); // a plane contact beside spatial ones: no second row
    for (const Vec3& axis : axes) interface.drive.push_back(dot(velocity, axis));
    interface.geometry.push_back(pair);
    interface.tangents.push_back({axes[0], axes.size() > 1 ? axes[1] : Vec3{}});
    interface.gap.push_back(contact.gap + pair.gap);
    const double area = pair.area > 0 ? pair.area : 1;
    if (compliant) interface.compliance.push_back(contact.compliance / area);
    if (elastic) interface.slip_compliance.push_back(contact.slip_compliance / area);
    if (const auto place = static_cast<PetscInt>(interface.geometry.size()) - 1; place < first || place >= last)
      continue;
    axes.insert(axes.begin(), pair.normal);
    for (const Vec3& axis : axes) rows.push_back(displacement_row(dofs, pair.nodes, axis));
  }
  add_shifts(interface, scene, dofs, comm);
  interface.B = matrix_of_rows(rows, dofs.last - dofs.first, comm);
  check_interface(interface, "contact", comm);
  return interface;
}

Interface read_interface(const std::filesystem::path& folder, const Structure& structure, const FrictionLaw& friction,
                         MPI_Comm comm)
{
  Interface interface;
  interface.friction = friction;
  if (!is_there(folder / "B.petsc", comm) && !is_there(folder / "gap.petsc", comm) &&
      !is_there(folder / "drive.petsc", comm))
  {
    interface.B = matrix_of_rows({}, own_rows(structure.M).size(), comm);
    return interface;
  }
  interface.gap = read_vector(folder / "gap.petsc", comm);
  interface.drive = read_vector(folder / "drive.petsc", comm);
  interface.pairs = static_cast<int>(interface.gap.size());
  const auto size = check_matrix_file(folder / "B.petsc", comm);
  const PetscInt dofs = row_count(structure.M);
  const std::string B = (folder / "B.petsc").string();
  if (size.columns != dofs)
    throw Error(B + ": " + std::to_string(size.columns) + " columns, but M.petsc has " + std::to_string(dofs));
  const std::optional<int> directions = directions_of<PetscInt>(size.rows, interface.pairs);
  if (!directions)
    throw Error(B + ": " + std::to_string(size.rows) + " rows for the " + std::to_string(interface.pairs) +
                " pairs of gap.petsc; each pair has its normal row and one or two tangential rows");
  interface.directions = *directions;
  if (interface.drive.size() != PairRows<std::size_t>(interface.directions).tangential_rows_of(interface.gap.size()))
    throw Error((folder / "drive.petsc").string() + ": length " + std::to_string(interface.drive.size()) + " for " +
                std::to_string(interface.pairs) + " pairs with " + std::to_string(interface.directions) +
                " tangential row(s) each in B.petsc");
  read_compliance(folder / "compliance.petsc", interface, comm);
  const auto [first, last] = local_range(interface.pairs, comm);
  interface.B = load_matrix(
      B, size, {PairRows<PetscInt>(interface.directions).rows_of(last - first), own_rows(structure.M).size()}, comm);
  check_interface(interface, folder.string(), comm);
  return interface;
}

std::vector<double> relative(const Interface& interface, Vec x)
{
  return std::move(relative(interface, std::span(&x, 1)).front());
}

std::vector<std::vector<double>> relative(const Interface& interface, std::span<const Vec> x)
{
  const Owned<Vec> rows = vector_of_rows(interface.B);
  const RowLayout layout = row_layout(interface.B);
  std::vector<double> own; // entries of one vector after the other
  for (const Vec vector : x)
  {
    check(MatMult(interface.B, vector, rows));
    const PetscScalar* entries = nullptr;
    check(VecGetArrayRead(rows, &entries));
    own.insert(own.end(), entries, entries + own_rows(interface.B).size());
    check(VecRestoreArrayRead(rows, &entries));
  }
  std::vector<double> whole(static_cast<std::size_t>(layout.total()) * x.size());
  const int vectors = to_int(x.size());
  (void)to_int(whole.size());
  RowLayout sent = layout;
  for (int& number : sent.counts) number *= vectors;
  for (int& number : sent.starts) number *= vectors;
  MPI_Allgatherv(own.data(), to_int(own.size()), MPI_DOUBLE, whole.data(), sent.counts.data(), sent.starts.data(),
                 MPI_DOUBLE, comm_of(interface.B));
  std::vector<std::vector<double>> result(x.size());
  auto from = whole.cbegin();
  for (const int count : layout.counts)
    for (std::vector<double>& entries : result)
    {
      entries.insert(entries.end(), from, from + count);
      from += count;
    }
  return result;
}

std::vector<double> contact_velocity(const Interface& interface, Vec v)
{
  std::vector<double> result = relative(interface, v);
  const TangentView drive(interface.drive, interface.directions);
  for (std::size_t pair = 0; pair < interface.gap.size(); ++pair)
    for (std::size_t k = 0; k < drive.of(pair).size(); ++k)
      PairView(result, interface.directions).tangential(pair)[k] -= drive.of(pair)[k];
  return result;
}

std::vector<ContactStatus> contact_status(const Interface& interface, const std::vector<double>& reactions, Vec v)
{
  if (!depends_on_speed(interface.friction)) return contact_status(interface, reactions, std::vector<double>{});
  return contact_status(interface, reactions, contact_velocity(interface, v));
}

void add_reactions(const Interface& interface, const std::vector<double>& r, Vec y)
{
  const Owned<Vec> rows = vector_of_rows(interface.B);
  set_all_entries(rows, r);
  check(MatMultTransposeAdd(interface.B, rows, y, y));
}

double slip_compliance_of(const Interface& interface, std::size_t pair)
{
  return interface.slip_compliance.empty() || !is_undriven(interface, pair) ? 0 : interface.slip_compliance[pair];
}

bool has_elastic_slip(const Interface& interface)
{
  for (std::size_t pair = 0; pair < interface.slip_compliance.size(); ++pair)
    if (slip_compliance_of(interface, pair) > 0) return true;
  return false;
}

std::vector<double> compliance_of_rows(const Interface& interface)
{
  std::vector<double> result;
  if (interface.compliance.empty() && interface.slip_compliance.empty()) return result;
  result.resize(interface.size());
  const PairView<double> rows(result, interface.directions);
  for (std::size_t pair = 0; pair < rows.pairs(); ++pair)
  {
    std::ranges::fill(rows.tangential(pair), slip_compliance_of(interface, pair));
    rows.normal(pair) = compliance_of(interface, pair);
  }
  return result;
}

std::vector<double> slip_positions(const Interface& interface, Vec u, const std::vector<double>& reactions)
{
  std::vector<double> position = relative(interface, u);
  const std::vector<double> compliance = compliance_of_rows(interface);
  for (std::size_t row = 0; row < compliance.size(); ++row) position[row] += compliance[row] * reactions[row];
  return position;
}

double drive_speed(const Interface& interface, std::size_t pair)
{
  return length(TangentView(interface.drive, interface.directions).of(pair));
}

bool is_undriven(const Interface& interface, std::size_t pair)
{
  return drive_speed(interface, pair) == 0 && friction_coefficient(interface.friction.of(pair), 0).value > 0;
}

bool has_undriven_pairs(const Interface& interface)
{
  for (std::size_t pair = 0; pair < interface.gap.size(); ++pair)
    if (is_undriven(interface, pair)) return true;
  return false;
}

std::vector<double> drive_directions(const Interface& interface)
{
  std::vector<double> result = interface.drive;
  const TangentView e(result, interface.directions);
  for (std::size_t pair = 0; pair < static_cast<std::size_t>(interface.pairs); ++pair)
  {
    const double speed = drive_speed(interface, pair);
    for (double& component : e.of(pair)) component = speed > 0 ? component / speed : 0;
  }
  return result;
}

std::vector<double> drive_friction(const Interface& interface)
{
  std::vector<double> mu;
  for (std::size_t pair = 0; pair < static_cast<std::size_t>(interface.pairs); ++pair)
    mu.push_back(friction_coefficient(interface.friction.of(pair), drive_speed(interface, pair)).value);
  return mu;
}

Owned<Mat> rows_of(const Interface& interface, const std::vector<int>& pairs, RowsTaken taken)
{
  const PairRows<PetscInt> rows_of_pairs(interface.directions);
  const IndexRange own = own_rows(interface.B);
  const PetscInt count = taken == RowsTaken::all ? rows_of_pairs.per_pair() : 1;
  std::vector<PetscInt> mine;
  for (const int pair : pairs)
    for (PetscInt k = 0; k < count; ++k)
      if (const PetscInt row = rows_of_pairs.normal(pair) + k; own.holds(row)) mine.push_back(row);
  const MPI_Comm comm = comm_of(interface.B);
  return part_of(interface.B, set_of(comm, mine), set_of(comm, own_columns(interface.B)));
}

} // namespace squeal
