// A ring disc between two pads with backing plates, each body meshed by itself with 10-node tetrahedra. Metres.
// Mid-plane z = 0, axis z. The disc's faces are whole rings; the pads cover a sector of them.
SetFactory("OpenCASCADE");
DefineConstant[
  disc_size = {0.024, Name "Mesh/edge length in the disc [m]"},
  pad_size = {0.014, Name "Mesh/edge length in the pads [m]"},
  inner_radius = {0.06, Name "Disc/inner radius [m]"},
  outer_radius = {0.14, Name "Disc/outer radius [m]"},
  thickness = {0.012, Name "Disc/thickness [m]"},
  pad_inner = {0.085, Name "Pads/inner radius [m]"},
  pad_outer = {0.135, Name "Pads/outer radius [m]"},
  pad_angle = {50, Name "Pads/angle [degree]"},
  lining = {0.01, Name "Pads/thickness of the lining [m]"},
  plate = {0.005, Name "Pads/thickness of the backing plate [m]"}
];

half = thickness / 2;
angle = pad_angle * Pi / 180;

Cylinder(1) = {0, 0, -half, 0, 0, thickness, outer_radius};
Cylinder(2) = {0, 0, -half, 0, 0, thickness, inner_radius};
BooleanDifference(10) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
tiny = thickness / 1000;
disc_top[] = Surface In BoundingBox{-1, -1, half - tiny, 1, 1, half + tiny};
disc_bottom[] = Surface In BoundingBox{-1, -1, -half - tiny, 1, 1, -half + tiny};
bore[] = Surface In BoundingBox{-inner_radius - tiny, -inner_radius - tiny, -1, inner_radius + tiny, inner_radius + tiny, 1};

// Linings 21 and 31, backing plates 22 and 32; those of a side share the nodes between them. A box that begins at x = 0
// holds the pads' faces but not the disc's.
For side In {0:1}
  first = 21 + 10 * side;
  face = half * (1 - 2 * side);
  back = face + (1 - 2 * side) * (lining + plate);
  low = face - side * lining;
  plate_low = (1 - side) * (face + lining) + side * back;
  Cylinder(101) = {0, 0, low, 0, 0, lining, pad_outer, angle};
  Cylinder(102) = {0, 0, low, 0, 0, lining, pad_inner, angle};
  BooleanDifference(first) = { Volume{101}; Delete; }{ Volume{102}; Delete; };
  Cylinder(103) = {0, 0, plate_low, 0, 0, plate, pad_outer, angle};
  Cylinder(104) = {0, 0, plate_low, 0, 0, plate, pad_inner, angle};
  BooleanDifference(first + 1) = { Volume{103}; Delete; }{ Volume{104}; Delete; };
  BooleanFragments{ Volume{first}; Delete; }{ Volume{first + 1}; Delete; }
  pad_face[] += Surface In BoundingBox{-tiny, -tiny, face - tiny, 1, 1, face + tiny};
  pad_back[] += Surface In BoundingBox{-tiny, -tiny, back - tiny, 1, 1, back + tiny};
EndFor

MeshSize{ PointsOf{ Volume{10}; } } = disc_size;
MeshSize{ PointsOf{ Volume{21, 22, 31, 32}; } } = pad_size;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeMax = disc_size;
Mesh.ElementOrder = 2;

Physical Volume("disc") = {10};
Physical Volume("linings") = {21, 31};
Physical Volume("plates") = {22, 32};
Physical Surface("disc_top") = disc_top[];
Physical Surface("disc_bottom") = disc_bottom[];
Physical Surface("bore") = bore[];
Physical Surface("pad_top") = pad_face[0];
Physical Surface("pad_bottom") = pad_face[1];
Physical Surface("back_top") = pad_back[0];
Physical Surface("back_bottom") = pad_back[1];
