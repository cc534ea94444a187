/// Words of gmsh's language after its grammar (Gmsh.l and Gmsh.y of gmsh 4.8 to 4.14). Of the words that geometries may
/// use, none reaches a file, a process or the environment.
#include "script_words.hpp"

#include "squeal/base/error.hpp"

#include <string>
#include <unordered_set>

namespace squeal
{

namespace
{

using Words = std::unordered_set<std::string>;

Words set_of_words(const char* text)
{
  const std::vector<std::string> words = words_in(text);
  return {words.begin(), words.end()};
}

const Words& allowed_words()
{
  static const Words words = set_of_words(
      // control and constants
      "If ElseIf Else EndIf For In EndFor Macro Function Return Call Include Merge DefineConstant DefineNumber "
      "UndefineConstant SetNumber GetNumber Exists Printf Error Warning Delete Recursive Model Physicals Meshes All "
      // attributes of constants
      "Name Min Max Step Range Choices Units Label Help Highlight Visible ReadOnly ReadOnlyRange Closed AutoCheck Loop "
      "Graph Index "
      // functions
      "Abs Acos ArcCos ArcSin ArcTan ArcTan2 Asin Atan Atan2 Ceil Cos Cosh Exp Fabs Floor Fmod Hypot Log Log10 Modulo "
      "Rand Round Sin Sinh Sqrt Tan Tanh Pi List LinSpace LogSpace Unique Find Str StrCat StrChoice StrCmp StrFind "
      "StrLen StrReplace StrSub Sprintf UpperCase LowerCase GMSH_MAJOR_VERSION GMSH_MINOR_VERSION GMSH_PATCH_VERSION "
      "newp newl newc newll newcl news newsl newv newf newreg "
      // entities
      "Point Curve Line Surface Volume Physical Plane Ruled Compound Circle Ellipse Ellipsis Spline BSpline CatmullRom "
      "Bezier Nurbs Knots Order Wire Using Left Right Alternate Progression Power Bump Beta AlternateLeft "
      "AlternateRight Rectangle Disk Sphere PolarSphere Box Block Cylinder Cone Torus Wedge Ellipsoid Filling "
      "ThruSections ThickSolid Fillet Chamfer Extrude Translate Rotate Symmetry Dilate Affine Split Intersect "
      "Coherence "
      "Duplicata Boundary CombinedBoundary PointsOf Parametric Coordinates Euclidian Closest Center CenterOfMass Mass "
      "MatrixOfInertia BoundingBox Bounding BooleanUnion BooleanFuse BooleanIntersection BooleanCommon "
      "BooleanDifference BooleanCut BooleanFragments BooleanCoherence BooleanSection SetFactory SetMaxTag HealShapes "
      "Sewing CreateTopology CreateGeometry ClassifySurfaces ShapeFromFile Embedded Parent Degenerated "
      // meshing
      "Mesh Geometry General Characteristic Length MeshSize MeshSizeFromBoundary MeshAlgorithm Transfinite Recombine "
      "Layers Holes Hole ScaleLastLayer RecombLaterals TransfQuadTri Smoother Periodic Reverse ReverseMesh RefineMesh "
      "RecombineMesh OptimizeMesh RelocateMesh RenumberMeshNodes RenumberMeshElements ReorientMesh SetOrder "
      "TransformMesh QuadTriAddVerts QuadTriNoNewVerts QuadTriDbl QuadTriSngl Combine Show Hide Color "
      // fields of mesh size
      "Field Background BoundaryLayer Attractor AttractorAnisoCurve Ball Constant Curvature Distance Extend Frustum "
      "Gradient IntersectAniso Laplacian LonLat MathEval MathEvalAniso MaxEigenHessian Mean Param Restrict Threshold "
      "AutomaticMeshSizeField MinAniso "
      // of the mesh itself
      "OpenCASCADE");
  return words;
}

/// Words that reach files, processes, the environment or the window, beside the allowed ones.
const Words& refused_words()
{
  static const Words words = set_of_words(
      "Abort AbsolutePath AdaptMesh Alias AliasWithOptions Append Betti Catenary CodeName Cohomology ColorTable "
      "CopyOptions Cpu CreateDir CurrentDir CurrentDirectory CurrentFileName DefineString DimNameSpace DirName Draw "
      "Elliptic Exit ExternalProcess FileExists FixRelativePath GeoEntity GetEnv GetForced GetForcedStr GetString "
      "GetStringValue GetValue GmshExecutableName Homology INTERPOLATION_SCHEME Levelset ListFromFile LowerCaseIn "
      "MPI_Rank MPI_Size Memory MergeWithBoundingBox N2S NameFromString NameStruct NameToString NewModel "
      "NonBlockingSystemCall Normal Octree OnelabAction OnelabRun Options Parametrizations Plugin PostProcessing "
      "PostView Print Quadric Remesh Remove S2N Save SetChanged SetCurrentWindow SetName SetPartition SetString SetTag "
      "Sleep Slide Solver SplitCurrentWindowHorizontal SplitCurrentWindowVertical StrPrefix StrRelative StringToName "
      "Struct Structured SyncModel System SystemCall T2 T3 TIME TestLevel TextAttributes Today TotalMemory "
      "UnsplitWindow Variables View");
  return words;
}

} // namespace

bool is_allowed_word(std::string_view word)
{
  return allowed_words().contains(std::string(word));
}

bool is_reserved_word(std::string_view word)
{
  return is_allowed_word(word) || refused_words().contains(std::string(word));
}

bool is_allowed_general_option(std::string_view name)
{
  static const Words words = set_of_words("Terminal Verbosity NumThreads ExpertMode");
  return words.contains(std::string(name));
}

bool is_allowed_text_option(std::string_view name)
{
  static const Words words = set_of_words("OCCTargetUnit PipeDefaultTrihedron");
  return words.contains(std::string(name));
}

} // namespace squeal
