#pragma once
/// Two blocks that gmsh meshes, and the errors of reading them.
#include "squeal/base/error.hpp"
#include "squeal/mesh/mesh.hpp"
#include "temporary_folder.hpp"

#include <functional>

namespace squeal::test
{

/// A file of this text and extension in a folder of its own.
class TemporaryFile
{
public:
  TemporaryFile(const std::string& text, const std::string& extension) : path_(folder_.write("file" + extension, text))
  {
  }
  const std::filesystem::path& path() const { return path_; }

private:
  TemporaryFolder folder_;
  std::filesystem::path path_;
};

/// Two unit blocks one above the other, n x n x 2 bricks each, that meet at z = 1 without sharing nodes.
inline const char* const blocks = R"(
DefineConstant[ n = {3, Min 1, Name "Mesh/n"}, shift = 0, top_n = 0 ];
Mesh.ElementOrder = 1;
Geometry.AutoCoherence = 0;
For high In {0:1}
  x0 = high * shift; dz = 2 * high - 1; m = (high && top_n) ? top_n : n;
  p = newp; Point(p) = {x0, 0, 1}; Point(p+1) = {x0+1, 0, 1}; Point(p+2) = {x0+1, 1, 1}; Point(p+3) = {x0, 1, 1};
  l = newl; Line(l) = {p, p+1}; Line(l+1) = {p+1, p+2}; Line(l+2) = {p+2, p+3}; Line(l+3) = {p+3, p};
  Transfinite Curve {l, l+1, l+2, l+3} = m + 1;
  s = news; Curve Loop(s) = {l, l+1, l+2, l+3}; Plane Surface(s) = {s};
  Transfinite Surface {s}; Recombine Surface {s};
  out[] = Extrude {0, 0, dz} { Surface{s}; Layers{2}; Recombine; };
  If (high)
    Physical Volume("high") = {out[1]}; Physical Surface("high_face") = {s}; Physical Surface("roof") = {out[0]};
  Else
    Physical Volume("low") = {out[1]}; Physical Surface("low_face") = {s}; Physical Surface("base") = {out[0]};
  EndIf
EndFor
)";

/// The blocks of a file, in contact.
inline Scene block_scene(const std::filesystem::path& file)
{
  Scene scene;
  scene.mesh = MeshSource{file, {}, 1};
  scene.parts = {{"low", {}, 0, {}}, {"high", {}, 0, {}}};
  Contact contact;
  contact.rotor = "low_face";
  contact.stator = "high_face";
  scene.contacts = {contact};
  return scene;
}

/// The scene's mesh on every rank; its file is rank 0's. Collective.
inline Mesh read_everywhere(const Scene& scene)
{
  Mesh mesh;
  on_rank_zero(MPI_COMM_WORLD, [&] { mesh = read_mesh(scene); });
  broadcast_mesh(mesh, MPI_COMM_WORLD);
  return mesh;
}

/// The text of the Error that work throws; empty if it throws none.
inline std::string problem_of(const std::function<void()>& work)
{
  try
  {
    work();
  }
  catch (const Error& error)
  {
    return error.what();
  }
  return "";
}

inline bool has(const std::string& text, const std::string& part)
{
  return text.find(part) != std::string::npos;
}

} // namespace squeal::test
