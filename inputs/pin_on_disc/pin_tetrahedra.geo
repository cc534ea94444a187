// The pin and the disc of pin.geo by 10-node tetrahedra of gmsh's automatic mesher, whose sizes can be chosen. Metres.
SetFactory("OpenCASCADE");
DefineConstant[
  divisions = {4, Min 1, Name "Mesh/elements across the pin"},
  inner_radius = {0.04, Name "Disc/clamped inner radius [m]"},
  outer_radius = {0.12, Name "Disc/outer radius [m]"},
  thickness = {0.012, Name "Disc/thickness [m]"},
  pin_inner = {0.08, Name "Pin/inner radius of its section [m]"},
  pin_outer = {0.1, Name "Pin/outer radius of its section [m]"},
  pin_angle = {14, Name "Pin/angle of its section [degree]"},
  pin_height = {0.025, Name "Pin/height [m]"}
];

If (inner_radius >= pin_inner || pin_inner >= pin_outer || pin_outer >= outer_radius || pin_angle >= 180)
  Error("the pin does not fit on the disc: check the radii and the angle");
EndIf

angle = pin_angle * Pi / 180;
Cylinder(1) = {0, 0, -thickness, 0, 0, thickness, outer_radius};
Cylinder(2) = {0, 0, -thickness, 0, 0, thickness, inner_radius};
BooleanDifference(10) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
Cylinder(3) = {0, 0, 0, 0, 0, pin_height, pin_outer, angle};
Cylinder(4) = {0, 0, 0, 0, 0, pin_height, pin_inner, angle};
BooleanDifference(20) = { Volume{3}; Delete; }{ Volume{4}; Delete; };
Rotate {{0, 0, 1}, {0, 0, 0}, -angle / 2} { Volume{20}; }

tiny = thickness / 1000;
disc_face[] = Surface In BoundingBox{-1, -1, -tiny, 1, 1, tiny}; // with the pin's, which begins at x > 0
pin_face[] = Surface In BoundingBox{tiny, -1, -tiny, 1, 1, tiny};
disc_face[] -= pin_face[];
pin_back[] = Surface In BoundingBox{tiny, -1, pin_height - tiny, 1, 1, pin_height + tiny};
bore[] = Surface In BoundingBox{-inner_radius - tiny, -inner_radius - tiny, -1, inner_radius + tiny, inner_radius + tiny, 1};

size = (pin_outer - pin_inner) / divisions;
MeshSize{ PointsOf{ Volume{10}; } } = 4 * size;
MeshSize{ PointsOf{ Volume{20}; } } = 2 * size;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeMax = 4 * size;
Mesh.ElementOrder = 2;

Physical Volume("disc") = {10};
Physical Volume("pin") = {20};
Physical Surface("disc_face") = disc_face[];
Physical Surface("pin_face") = pin_face[];
Physical Surface("pin_back") = pin_back[];
Physical Surface("bore") = bore[];
