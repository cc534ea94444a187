#include "dof_names.hpp"

#include "squeal/base/broadcast.hpp"
#include "squeal/mesh/names.hpp"
#include "squeal/mesh/shapes.hpp"

namespace squeal
{

void name_nodes(const Mesh& mesh, const Scene& scene, DofNames& names)
{
  names.at = mesh.nodes;
  names.body.assign(mesh.nodes.size(), 0);
  for (const Part& part : scene.parts) names.bodies.push_back("part " + part.name);
  for (const Element& element : mesh.elements)
    for (const int node : nodes_of(element)) names.body[node] = element.part;
  const auto name_point = [&](const std::string& kind, const std::string& name)
  {
    names.body[mesh.points.at(name)] = static_cast<int>(names.bodies.size());
    names.bodies.push_back(kind + " " + name);
  };
  for (const Point& point : scene.points) name_point("point", point.name);
  for (const RigidBody& body : scene.rigid_bodies) name_point("rigid body", body.name);
  for (std::size_t i = 0; i < mesh.superelements.size(); ++i)
  {
    for (const SuperelementRow& row : mesh.superelements[i])
      if (row.coordinate) names.body[row.node] = static_cast<int>(names.bodies.size());
    names.bodies.push_back("superelement " + scene.superelements[i].name);
  }
}

std::string describe(const DofNames& names, PetscInt dof)
{
  if (names.nodal_dof.empty())
  {
    const std::string row = "dof " + std::to_string(names.file_rows.empty() ? dof : names.file_rows.at(dof));
    if (names.file_motions.empty() || names.file_motions.at(dof).motion < 0) return row;
    const auto [node, motion] = names.file_motions[dof];
    return row + " (node " + std::to_string(node) + ", " + motion_words[motion] + ")";
  }
  const PetscInt nodal_dof = names.nodal_dof.at(dof);
  const int node = static_cast<int>(nodal_dof / 6);
  return names.bodies[names.body[node]] + ", " + node_text(node, names.at[node]) + ", direction " +
         motion_words[nodal_dof % 6];
}

std::string describe(const DofNames& names, PetscInt dof, MPI_Comm comm)
{
  std::string text = rank_of(comm) == 0 ? describe(names, dof) : std::string();
  broadcast(text, comm);
  return text;
}

} // namespace squeal
