// A pin pressed on a disc. Metres; the disc's face is z = 0, its axis z. Every dimension is chosen.
//
// The face is cut into bands (radii) and columns (angles); the cell of band 1 and column 0 is the pin's footprint. The
// pin is extruded from a second copy of that cell, built away from the disc so that gmsh does not merge the two, and
// brought into place at the end: its face has nodes of its own in the places of the disc's. All 8-node bricks.
DefineConstant[
  divisions = {4, Min 1, Step 1, Name "Mesh/elements across the pin"},
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

columns = 4; // column 0 carries the pin; three others, so that no arc reaches half a turn
radius[] = {inner_radius, pin_inner, pin_outer, outer_radius};
n_radial[] = {divisions, divisions, Ceil(divisions / 2)};
For j In {0:columns-1}
  angle[j] = (j == 0) ? -pin_angle / 2 : pin_angle / 2 + (j - 1) * (360 - pin_angle) / 3;
  n_angular[j] = (j == 0) ? divisions : 2 * divisions;
EndFor

Mesh.ElementOrder = 1;
away = 10 * outer_radius;
For copy In {0:1} // 0: the disc's face, 1: the pin's
  z = copy * away;
  grid[] = {}; round[] = {}; radial[] = {};
  centre = newp; Point(centre) = {0, 0, z};
  i_first = copy ? 1 : 0; i_last = copy ? 2 : 3; j_last = copy ? 1 : columns - 1;
  For i In {i_first:i_last}
    For j In {0:j_last}
      p = newp; Point(p) = {radius[i] * Cos(angle[j] * Pi / 180), radius[i] * Sin(angle[j] * Pi / 180), z};
      grid[i * columns + j] = p;
    EndFor
  EndFor
  For i In {i_first:i_last}
    For j In {0:j_last}
      If (!copy || j == 0)
        c = newc; Circle(c) = {grid[i * columns + j], centre, grid[i * columns + (j + 1) % columns]};
        Transfinite Curve{c} = n_angular[j] + 1; round[i * columns + j] = c;
      EndIf
      If (i < i_last)
        c = newc; Line(c) = {grid[i * columns + j], grid[(i + 1) * columns + j]};
        Transfinite Curve{c} = n_radial[i] + 1; radial[i * columns + j] = c;
      EndIf
    EndFor
  EndFor
  For i In {i_first:i_last-1}
    For j In {0:copy ? 0 : columns - 1}
      s = news; next = (j + 1) % columns;
      Curve Loop(s) = {radial[i * columns + j], round[(i + 1) * columns + j], -radial[i * columns + next], -round[i * columns + j]};
      Plane Surface(s) = {s};
      If (copy)
        pin_face = s;
      Else
        face[] += s;
      EndIf
    EndFor
  EndFor
EndFor
Transfinite Surface{:};
Recombine Surface{:};

// Extrusion returns, for each surface, its copy, the volume and the four sides in the order of the surface's curves.
down[] = Extrude {0, 0, -thickness} { Surface{face[]}; Layers{Ceil(divisions / 2)}; Recombine; };
up[] = Extrude {0, 0, pin_height} { Surface{pin_face}; Layers{divisions}; Recombine; };
For s In {0:#face[]-1}
  disc[] += down[6 * s + 1];
  If (s < columns)
    bore[] += down[6 * s + 5];
  EndIf
EndFor
Geometry.AutoCoherence = 0;
Translate {0, 0, -away} { Volume{up[1]}; }

Physical Volume("disc") = disc[];
Physical Volume("pin") = up[1];
Physical Surface("disc_face") = face[columns]; // the footprint
Physical Surface("pin_face") = pin_face;
Physical Surface("pin_back") = up[0];
Physical Surface("bore") = bore[];
