// The TGV brake of Charroyer, Chiello and Sinou 2017, Fig. 1: a solid disc on a shell hub, and on either side a pad of
// cylindrical pins. Metres. Mid-plane z = 0, axis z; every dimension is chosen (the paper gives none): see README.md.
//
// The mid-plane is cut into bands (radii) and columns (angles). Cells of the pad hold a pin's footprint, a square in a
// circle in five blocks; all blocks are transfinite, and extruded into 8-node bricks. Pins are built from the same
// points, away from the disc so that gmsh does not merge them with it, and brought into place at the end: their faces
// have nodes of their own in the places of the disc's.
DefineConstant[
  size = {32000, Min 4000, Name "Mesh/about so many degrees of freedom"},
  inner_radius = {0.12, Name "Disc/inner radius [m]"},
  outer_radius = {0.32, Name "Disc/outer radius [m]"},
  thickness = {0.045, Name "Disc/thickness [m]"},
  hub_radius = {0.06, Name "Hub/clamped inner radius [m]"},
  pin_radius = {0.02, Name "Pins/radius [m]"},
  pin_height = {0.038, Name "Pins/height [m]"},
  pin_rings = {3, Min 1, Step 1, Name "Pins/rings a side"},
  pin_columns = {3, Min 1, Step 1, Name "Pins/columns a side"},
  pin_first_radius = {0.19, Name "Pins/radius of the innermost ring [m]"},
  pin_pitch = {0.045, Name "Pins/distance of rings [m]"},
  pin_angle = {14, Name "Pins/angle between columns [degree]"},
  pin_refinement = {1, Name "Mesh/elements of a pin's face along a side over those of the disc below it"}
];

first_edge = pin_first_radius - pin_pitch / 2;
last_edge = first_edge + pin_rings * pin_pitch;
If (pin_radius > 0.45 * pin_pitch || pin_radius > 0.45 * pin_first_radius * pin_angle * Pi / 180)
  Error("pins of radius %g m do not fit: raise pin_pitch or pin_angle", pin_radius);
EndIf
If (first_edge <= inner_radius || last_edge >= outer_radius || pin_columns * pin_angle > 300 || hub_radius >= inner_radius)
  Error("the pins, the disc and the hub do not fit in one another: check the radii and the angle");
EndIf

// Divisions, k = 1 at 32 000 degrees of freedom.
k = (size / 32000) ^ (1 / 3);
n = 2 * Max(1, Round(2 * k));          // of a quarter of a pin's circle, and of a cell's side
n_ring = Max(1, Round(2 * k));         // from a pin's inner square to its circle
n_cell = Max(1, Round(k));             // from the circle to the cell's side
n_pin = Max(2, Round(4.9 * k));          // along a pin
n_half = Max(1, Round(2 * k));         // through half the disc
n_hub = Max(2, Round(3.9 * k));
n_inner = Max(1, Round((first_edge - inner_radius) * 50 * k));
n_outer = Max(1, Round((outer_radius - last_edge) * 50 * k));
rest = 4;                              // columns without pins: arcs must stay below half a turn
n_rest = Max(3, Round(8 * k));

Geometry.CopyMeshingMethod = 1;
Mesh.ElementOrder = 1;
Mesh.MeshSizeExtendFromBoundary = 0;

// Radii and angles of the grid.
radius[] = {hub_radius, inner_radius};
n_radial[] = {n_hub, n_inner};
For i In {0:pin_rings-1}
  radius[] += first_edge + i * pin_pitch; n_radial[] += n;
EndFor
radius[] += {last_edge, outer_radius}; n_radial[] += n_outer;
bands = #n_radial[];
columns = pin_columns + rest;
rest_angle = (360 - pin_columns * pin_angle) / rest;
For j In {0:columns-1}
  If (j < pin_columns)
    angle[j] = (j - pin_columns / 2) * pin_angle * Pi / 180; n_angular[j] = n;
  Else
    angle[j] = (pin_columns * pin_angle / 2 + (j - pin_columns) * rest_angle) * Pi / 180; n_angular[j] = n_rest;
  EndIf
EndFor

// The grid: points grid[], lines outward radial[], arcs round[]; [i * columns + j] is at radius i, angle j.
centre = newp; Point(centre) = {0, 0, 0};
For i In {0:bands}
  For j In {0:columns-1}
    p = newp; Point(p) = {radius[i] * Cos(angle[j]), radius[i] * Sin(angle[j]), 0}; grid[] += p;
  EndFor
EndFor
For i In {0:bands}
  For j In {0:columns-1}
    c = newc; Circle(c) = {grid[i * columns + j], centre, grid[i * columns + (j + 1) % columns]};
    Transfinite Curve{c} = n_angular[j] + 1; round[] += c;
    If (i < bands)
      c = newc; Line(c) = {grid[i * columns + j], grid[(i + 1) * columns + j]};
      Transfinite Curve{c} = n_radial[i] + 1; radial[] += c;
    EndIf
  EndFor
EndFor

// Cells without a pin; band 0 is the hub.
For i In {0:bands-1}
  For j In {0:columns-1}
    If (i < 2 || i >= bands - 1 || j >= pin_columns)
      next = (j + 1) % columns;
      s = news; Curve Loop(s) = {radial[i * columns + j], round[(i + 1) * columns + j], -radial[i * columns + next], -round[i * columns + j]};
      Plane Surface(s) = {s};
      If (i == 0)
        hub[] += s;
      Else
        plain[] += s;
      EndIf
    EndIf
  EndFor
EndFor

// Cells with a pin, and the pin's section three times: below, in the disc's mid-plane, above.
away = 10 * outer_radius;
For i In {2:bands-2}
  For j In {0:pin_columns-1}
    r = (radius[i] + radius[i + 1]) / 2; a = angle[j] + pin_angle * Pi / 360;
    For side In {-1:1}
      z = side * (thickness / 2 + away);
      n_arc = n; n_spoke = n_ring;
      If (side != 0)
        n_arc = Round(n * pin_refinement); n_spoke = Round(n_ring * pin_refinement);
      EndIf
      o = newp; Point(o) = {r * Cos(a), r * Sin(a), z};
      For q In {0:3} // corners, in the order of the cell's: inner, outer, outer next column, inner next column
        turn = a + (5 + 2 * q) * Pi / 4;
        p = newp; Point(p) = {r * Cos(a) + pin_radius * Cos(turn), r * Sin(a) + pin_radius * Sin(turn), z}; on[q] = p;
        p = newp; Point(p) = {r * Cos(a) + 0.5 * pin_radius * Cos(turn), r * Sin(a) + 0.5 * pin_radius * Sin(turn), z}; in[q] = p;
      EndFor
      For q In {0:3}
        c = newc; Circle(c) = {on[q], o, on[(q + 1) % 4]}; Transfinite Curve{c} = n_arc + 1; arc[q] = c;
        c = newc; Line(c) = {in[q], in[(q + 1) % 4]}; Transfinite Curve{c} = n_arc + 1; edge[q] = c;
        c = newc; Line(c) = {in[q], on[q]}; Transfinite Curve{c} = n_spoke + 1; spoke[q] = c;
      EndFor
      section[] = {};
      s = news; Curve Loop(s) = {edge[]}; Plane Surface(s) = {s}; section[] += s;
      For q In {0:3}
        s = news; Curve Loop(s) = {edge[q], spoke[(q + 1) % 4], -arc[q], -spoke[q]}; Plane Surface(s) = {s}; section[] += s;
      EndFor
      If (side < 0)
        face_bottom[] += section[];
      ElseIf (side > 0)
        face_top[] += section[];
      Else
        footprint[] += section[];
        next = (j + 1) % columns;
        corner[] = {grid[i * columns + j], grid[(i + 1) * columns + j], grid[(i + 1) * columns + next], grid[i * columns + next]};
        border[] = {radial[i * columns + j], round[(i + 1) * columns + j], -radial[i * columns + next], -round[i * columns + j]};
        For q In {0:3}
          c = newc; Line(c) = {on[q], corner[q]}; Transfinite Curve{c} = n_cell + 1; ray[q] = c;
        EndFor
        For q In {0:3}
          s = news; Curve Loop(s) = {arc[q], ray[(q + 1) % 4], -border[q], -ray[q]}; Plane Surface(s) = {s}; plain[] += s;
        EndFor
      EndIf
    EndFor
  EndFor
EndFor
Transfinite Surface{:};
Recombine Surface{:};

// Extrusion returns, for each surface, its copy, the volume and four sides; sides that touch are merged once, after it.
Geometry.AutoCoherence = 0;
up[] = Extrude {0, 0, thickness / 2} { Surface{footprint[], plain[]}; Layers{n_half}; Recombine; };
down[] = Extrude {0, 0, -thickness / 2} { Surface{footprint[], plain[]}; Layers{n_half}; Recombine; };
top[] = Extrude {0, 0, pin_height} { Surface{face_top[]}; Layers{n_pin}; Recombine; };
bottom[] = Extrude {0, 0, -pin_height} { Surface{face_bottom[]}; Layers{n_pin}; Recombine; };
For s In {0:#footprint[]+#plain[]-1}
  disc[] += {up[6 * s + 1], down[6 * s + 1]};
  disc_top[] += up[6 * s]; disc_bottom[] += down[6 * s];
EndFor
For s In {0:#footprint[]-1}
  pads_top[] += top[6 * s + 1]; pads_top_back[] += top[6 * s];
  pads_bottom[] += bottom[6 * s + 1]; pads_bottom_back[] += bottom[6 * s];
EndFor

Coherence;
Translate {0, 0, -away} { Volume{pads_top[]}; }
Translate {0, 0, away} { Volume{pads_bottom[]}; }

Physical Volume("disc") = disc[];
Physical Volume("pads_top") = pads_top[];
Physical Volume("pads_bottom") = pads_bottom[];
Physical Surface("hub") = hub[];
Physical Surface("disc_top") = disc_top[];
Physical Surface("disc_bottom") = disc_bottom[];
Physical Surface("pads_top_face") = face_top[];
Physical Surface("pads_bottom_face") = face_bottom[];
Physical Surface("pads_top_back") = pads_top_back[];
Physical Surface("pads_bottom_back") = pads_bottom_back[];
Physical Curve("hub_inner") = round[{0:columns-1}];
