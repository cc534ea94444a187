// A brake corner: a solid disc with its hat, a floating calliper with its piston on two guide pins, a bracket, and two
// pads of lining, backplate and shim. Metres. Axis of rotation z, the disc's mid-plane is z = 0, the pads are at y > 0;
// x is along the rotor, y is outward. "inner" is the vehicle's side, z < 0, with the piston; "outer" the wheel's.
//
// Every body is extruded from quadrilaterals into 20-node bricks and has nodes of its own. No corner of one is in the
// place of another's, else gmsh would merge them.
DefineConstant[
  size = {60000, Min 5000, Name "Mesh/about so many degrees of freedom"},
  outer_radius = {0.14, Name "Disc/outer radius [m]"},
  thickness = {0.012, Name "Disc/thickness [m]"},
  hat_radius = {0.07, Name "Disc/outer radius of the hat [m]"},
  hat_wall = {0.008, Name "Disc/thickness of the hat's wall and flange [m]"},
  hat_height = {0.034, Name "Disc/height of the hat [m]"},
  bore_radius = {0.035, Name "Disc/inner radius of the flange [m]"},
  pad_inner = {0.088, Name "Pads/inner radius [m]"},
  pad_outer = {0.136, Name "Pads/outer radius [m]"},
  pad_angle = {53, Name "Pads/angle [degree]"},
  lining = {0.010, Name "Pads/thickness of the lining [m]"},
  plate = {0.005, Name "Pads/thickness of the backplate [m]"},
  shim = {0.001, Name "Pads/thickness of the shim [m]"},
  piston_radius = {0.0235, Name "Calliper/radius of the bore [m]"},
  pin_radius = {0.006, Name "Calliper/radius of a guide pin [m]"}
];

// Divisions: k = 1 at 9 000 degrees of freedom.
k = (size / 9000) ^ (1 / 3);
Mesh.ElementOrder = 2;
Mesh.SecondOrderIncomplete = 1;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.RecombineAll = 1;

half = thickness / 2;
n_thin = Max(1, Round(0.8 * k));  // through plates
n_one = Max(1, Round(1 * k));
n_two = Max(1, Round(2 * k));
n_three = Max(1, Round(3 * k));
n_four = Max(1, Round(4 * k));

// ---------------------------------------------------------------------------------------------------------------- disc
// Its section in r and z, at y = 0, is turned by four quarters.
r[] = {bore_radius, hat_radius - hat_wall, hat_radius, outer_radius};
top = half + hat_height;
p1 = newp; Point(p1) = {r[1], 0, -half}; p2 = newp; Point(p2) = {r[2], 0, -half}; p3 = newp; Point(p3) = {r[3], 0, -half};
p4 = newp; Point(p4) = {r[1], 0, half}; p5 = newp; Point(p5) = {r[2], 0, half}; p6 = newp; Point(p6) = {r[3], 0, half};
p7 = newp; Point(p7) = {r[1], 0, top}; p8 = newp; Point(p8) = {r[2], 0, top}; p9 = newp; Point(p9) = {r[0], 0, top};
p10 = newp; Point(p10) = {r[1], 0, top + hat_wall}; p11 = newp; Point(p11) = {r[2], 0, top + hat_wall};
p12 = newp; Point(p12) = {r[0], 0, top + hat_wall};
l1 = newc; Line(l1) = {p1, p2}; l2 = newc; Line(l2) = {p2, p3}; l3 = newc; Line(l3) = {p4, p5}; l4 = newc; Line(l4) = {p5, p6};
l5 = newc; Line(l5) = {p1, p4}; l6 = newc; Line(l6) = {p2, p5}; l7 = newc; Line(l7) = {p3, p6};
l8 = newc; Line(l8) = {p4, p7}; l9 = newc; Line(l9) = {p5, p8}; l10 = newc; Line(l10) = {p7, p8};
l11 = newc; Line(l11) = {p7, p10}; l12 = newc; Line(l12) = {p8, p11}; l13 = newc; Line(l13) = {p10, p11};
l14 = newc; Line(l14) = {p9, p7}; l15 = newc; Line(l15) = {p12, p10}; l16 = newc; Line(l16) = {p9, p12};
Transfinite Curve{l1, l3, l10, l13} = n_thin + 1;
Transfinite Curve{l5, l6, l7, l11, l12, l16} = n_thin + 1;
Transfinite Curve{l2, l4} = n_three + 1;
Transfinite Curve{l8, l9, l14, l15} = n_one + 1;
s1 = news; Curve Loop(s1) = {l1, l6, -l3, -l5}; Plane Surface(s1) = {s1};
s2 = news; Curve Loop(s2) = {l2, l7, -l4, -l6}; Plane Surface(s2) = {s2};
s3 = news; Curve Loop(s3) = {l3, l9, -l10, -l8}; Plane Surface(s3) = {s3};
s4 = news; Curve Loop(s4) = {l10, l12, -l13, -l11}; Plane Surface(s4) = {s4};
s5 = news; Curve Loop(s5) = {l14, l11, -l15, -l16}; Plane Surface(s5) = {s5};
section[] = {s1, s2, s3, s4, s5};
n_quarter = Max(1, Round(6 * k));
For quarter In {0:3}
  next[] = {};
  For i In {0:4}
    Transfinite Surface{section[i]};
    out[] = Extrude{ {0, 0, 1}, {0, 0, 0}, Pi / 2 }{ Surface{section[i]}; Layers{n_quarter}; Recombine; };
    next[] += out[0]; disc[] += out[1];
    If (i == 1)
      disc_inner[] += out[2]; disc_outer[] += out[4];
    EndIf
    If (i == 4)
      hub[] += out[4];
    EndIf
  EndFor
  section[] = next[];
EndFor

// ---------------------------------------------------------------------------------------------------------------- pads
// A sector, and at each end an ear with a tab that stands in the bracket. Its foot ends at a relief before the tab's face:
// a node of both would have two pairs along the same motions.
tab_in = 0.062; relief = 0.069; tab_end = 0.072; ledge = 0.088; tab_top = 0.108;
angle = pad_angle * Pi / 360;
shim_inner_radius = pad_inner + 0.002; shim_outer_radius = pad_outer - 0.002; shim_angle = angle * 0.57;
For side In {-1:1:2}
  z = side * (half + lining);
  o = newp; Point(o) = {0, 0, z};
  a1 = newp; Point(a1) = {-pad_inner * Sin(angle), pad_inner * Cos(angle), z};
  a2 = newp; Point(a2) = {-pad_outer * Sin(angle), pad_outer * Cos(angle), z};
  b1 = newp; Point(b1) = {pad_inner * Sin(angle), pad_inner * Cos(angle), z};
  b2 = newp; Point(b2) = {pad_outer * Sin(angle), pad_outer * Cos(angle), z};
  l1 = newc; Circle(l1) = {b1, o, a1}; l2 = newc; Line(l2) = {a1, a2}; l3 = newc; Circle(l3) = {a2, o, b2};
  l4 = newc; Line(l4) = {b2, b1};
  Transfinite Curve{l1, l3} = n_four + 1; Transfinite Curve{l2, l4} = n_two + 1;
  sector = news; Curve Loop(sector) = {l1, l2, l3, l4}; Plane Surface(sector) = {sector};
  Transfinite Surface{sector};
  ears[] = {};
  For end In {-1:1:2} // -1: where the rotor leaves the pad
    If (end < 0)
      c1 = a1; c2 = a2; edge = l2;
    Else
      c1 = b1; c2 = b2; edge = -l4;
    EndIf
    d1 = newp; Point(d1) = {end * tab_in, ledge, z}; d2 = newp; Point(d2) = {end * tab_in, tab_top, z};
    f1 = newp; Point(f1) = {end * relief, ledge, z}; f2 = newp; Point(f2) = {end * relief, tab_top, z};
    e1 = newp; Point(e1) = {end * tab_end, ledge, z}; e2 = newp; Point(e2) = {end * tab_end, tab_top, z};
    m1 = newc; Line(m1) = {c1, d1}; m2 = newc; Line(m2) = {d1, d2}; m3 = newc; Line(m3) = {d2, c2};
    m4 = newc; Line(m4) = {d1, f1}; m5 = newc; Line(m5) = {f1, f2}; m6 = newc; Line(m6) = {f2, d2};
    m7 = newc; Line(m7) = {f1, e1}; m8 = newc; Line(m8) = {e1, e2}; m9 = newc; Line(m9) = {e2, f2};
    Transfinite Curve{m2, m5, m8} = n_two + 1; Transfinite Curve{m1, m3, m4, m6, m7, m9} = n_one + 1;
    s = news; Curve Loop(s) = {m1, m2, m3, -edge}; Plane Surface(s) = {s}; ears[] += s; Transfinite Surface{s};
    s = news; Curve Loop(s) = {m4, m5, m6, -m2}; Plane Surface(s) = {s}; ears[] += s; Transfinite Surface{s};
    s = news; Curve Loop(s) = {m7, m8, m9, -m5}; Plane Surface(s) = {s}; ears[] += s; Transfinite Surface{s};
  EndFor
  out[] = Extrude{0, 0, -side * lining}{ Surface{sector}; Layers{n_one}; Recombine; };
  linings[] += out[1]; lining_face[] += out[0];
  out[] = Extrude{0, 0, side * plate}{ Surface{sector}; Layers{n_thin}; Recombine; };
  plates[] += out[1]; back[] += out[0]; clip[] += out[4];
  For i In {0:5}
    out[] = Extrude{0, 0, side * plate}{ Surface{ears[i]}; Layers{n_thin}; Recombine; };
    plates[] += out[1];
    If (i % 3 == 1)
      tab_ledge[] += out[2];
    EndIf
    If (i % 3 == 2)
      tab_relief[] += out[2]; tab_face[] += out[3];
    EndIf
  EndFor

  z = side * (half + lining + plate);
  o = newp; Point(o) = {0, 0, z};
  a1 = newp; Point(a1) = {-shim_inner_radius * Sin(shim_angle), shim_inner_radius * Cos(shim_angle), z};
  a2 = newp; Point(a2) = {-shim_outer_radius * Sin(shim_angle), shim_outer_radius * Cos(shim_angle), z};
  b1 = newp; Point(b1) = {shim_inner_radius * Sin(shim_angle), shim_inner_radius * Cos(shim_angle), z};
  b2 = newp; Point(b2) = {shim_outer_radius * Sin(shim_angle), shim_outer_radius * Cos(shim_angle), z};
  l1 = newc; Circle(l1) = {b1, o, a1}; l2 = newc; Line(l2) = {a1, a2}; l3 = newc; Circle(l3) = {a2, o, b2};
  l4 = newc; Line(l4) = {b2, b1};
  Transfinite Curve{l1, l3} = n_three + 1; Transfinite Curve{l2, l4} = n_two + 1;
  s = news; Curve Loop(s) = {l1, l2, l3, l4}; Plane Surface(s) = {s}; Transfinite Surface{s};
  out[] = Extrude{0, 0, side * shim}{ Surface{s}; Layers{1}; Recombine; };
  shims[] += out[1]; shim_plate[] += s; shim_back[] += out[0];
EndFor

// ------------------------------------------------------------------------------------------------------------- bracket
// Inner pillars and the beam between them are extruded from a grid of cells; the arms over the disc carry the outer ones.
x[] = {-0.088, -tab_end, -tab_in, tab_in, tab_end, 0.088};
y[] = {0.056, 0.074, ledge, tab_top, 0.126, 0.140};
z_back = -(half + lining + plate + shim + 0.006); z_arm = half + 0.004;
n_x[] = {n_one, n_one, n_four, n_one, n_one};
n_y[] = {n_one, n_one, n_one, n_one, n_one};
For j In {0:5}
  For i In {0:5}
    q = newp; Point(q) = {x[i], y[j], z_back}; grid[j * 6 + i] = q; along[j * 6 + i] = 0; up[j * 6 + i] = 0;
  EndFor
EndFor
For j In {0:4}
  For i In {0:4}
    // cells: the beam, under and beside the tabs, above them beside the tabs
    used = j == 0 || (j == 1 && i != 2) || i == 0 || i == 4;
    If (used)
      For t In {0:1}
        at = (j + t) * 6 + i;
        If (along[at] == 0)
          c = newc; Line(c) = {grid[at], grid[at + 1]}; Transfinite Curve{c} = n_x[i] + 1; along[at] = c;
        EndIf
        at = j * 6 + i + t;
        If (up[at] == 0)
          c = newc; Line(c) = {grid[at], grid[at + 6]}; Transfinite Curve{c} = n_y[j] + 1; up[at] = c;
        EndIf
      EndFor
      s = news; at = j * 6 + i;
      Curve Loop(s) = {along[at], up[at + 1], -along[at + 6], -up[at]}; Plane Surface(s) = {s}; Transfinite Surface{s};
      out[] = Extrude{0, 0, -z_arm - z_back}{ Surface{s}; Layers{n_one}; Recombine; };
      bracket[] += out[1];
      If (j == 0 && i != 2)
        mount[] += s;
      EndIf
      If (j == 1 && (i == 1 || i == 3))
        inner_ledge[] += out[4];
      EndIf
      If (j == 2)
        If (i == 0)
          inner_abutment[] += out[3];
        Else
          inner_abutment[] += out[5];
        EndIf
      EndIf
      If (j == 3)
        sleeve[] += s;
      EndIf
      If (j == 4)
        arm = out[0]; // over the disc, to the outer pillar
        out[] = Extrude{0, 0, 2 * z_arm}{ Surface{arm}; Layers{n_one}; Recombine; };
        bracket[] += out[1]; arm = out[0];
        out[] = Extrude{0, 0, -z_arm - z_back}{ Surface{arm}; Layers{n_one}; Recombine; };
        bracket[] += out[1]; below = out[2];
        For t In {3:1:-1}
          out[] = Extrude{0, y[t] - y[t + 1], 0}{ Surface{below}; Layers{n_y[t]}; Recombine; };
          bracket[] += out[1]; below = out[0];
        EndFor
        // faces towards the tab, of the lowest cell and of the one above it
        towards = i == 0 ? x[1] : x[4];
        z_out = -z_back;
        e = 0.0001;
        face[] = Surface In BoundingBox{towards - e, y[1] - e, z_arm - e, towards + e, y[2] + e, z_out + e};
        outer_abutment[] += Surface In BoundingBox{towards - e, y[2] - e, z_arm - e, towards + e, y[3] + e, z_out + e};
        outer_abutment[] -= tab_face[];
        step = i == 0 ? x[2] - x[1] : x[3] - x[4];
        out[] = Extrude{step, 0, 0}{ Surface{face[0]}; Layers{n_one}; Recombine; };
        bracket[] += out[1];
        under_low = i == 0 ? x[1] : x[3]; under_high = i == 0 ? x[2] : x[4];
        outer_ledge[] += Surface In BoundingBox{under_low - e, y[2] - e, z_arm - e, under_high + e, y[2] + e, z_out + e};
        outer_ledge[] -= {tab_ledge[], tab_relief[]};
      EndIf
    EndIf
  EndFor
EndFor

// ------------------------------------------------------------------------------------------------------------ calliper
centre_y = 0.111; square = 0.036; third = 0.014; bridge_top = 0.162;
z_end = -0.075; z_bottom = -0.063; z_seal = -0.050; z_mouth = -0.030;
z_finger = half + lining + plate + shim; z_tip = z_finger + 0.014;
s_x[] = {-square, -third, third, square, square, square, square, third, -third, -square, -square, -square};
s_y[] = {-square, -square, -square, -square, -third, third, square, square, square, square, third, -third};
o = newp; Point(o) = {0, centre_y, z_end};
core = 0.45;
For i In {0:11}
  length = Sqrt(s_x[i]^2 + s_y[i]^2);
  q = newp; Point(q) = {s_x[i], centre_y + s_y[i], z_end}; outside[i] = q;
  q = newp; Point(q) = {piston_radius * s_x[i] / length, centre_y + piston_radius * s_y[i] / length, z_end}; round[i] = q;
  q = newp; Point(q) = {core * piston_radius * s_x[i] / square, centre_y + core * piston_radius * s_y[i] / square, z_end}; inside[i] = q;
EndFor
For i In {0:11}
  t = (i + 1) % 12;
  c = newc; Line(c) = {outside[i], outside[t]}; Transfinite Curve{c} = n_one + 1; line_out[i] = c;
  c = newc; Circle(c) = {round[i], o, round[t]}; Transfinite Curve{c} = n_one + 1; line_round[i] = c;
  c = newc; Line(c) = {inside[i], inside[t]}; Transfinite Curve{c} = n_one + 1; line_in[i] = c;
  c = newc; Line(c) = {outside[i], round[i]}; Transfinite Curve{c} = n_one + 1; spoke[i] = c;
  c = newc; Line(c) = {round[i], inside[i]}; Transfinite Curve{c} = n_one + 1; inner_spoke[i] = c;
EndFor
s = news; Curve Loop(s) = {line_in[]}; Plane Surface(s) = {s}; Transfinite Surface{s} = {inside[0], inside[3], inside[6], inside[9]};
out[] = Extrude{0, 0, z_bottom - z_end}{ Surface{s}; Layers{n_one}; Recombine; }; calliper[] += out[1]; bore_bottom[] += out[0];
For i In {0:11}
  t = (i + 1) % 12;
  s = news; Curve Loop(s) = {line_round[i], inner_spoke[t], -line_in[i], -inner_spoke[i]}; Plane Surface(s) = {s}; Transfinite Surface{s};
  out[] = Extrude{0, 0, z_bottom - z_end}{ Surface{s}; Layers{n_one}; Recombine; }; calliper[] += out[1]; bore_bottom[] += out[0];
  s = news; Curve Loop(s) = {line_out[i], spoke[t], -line_round[i], -spoke[i]}; Plane Surface(s) = {s}; Transfinite Surface{s};
  out[] = Extrude{0, 0, z_bottom - z_end}{ Surface{s}; Layers{n_one}; Recombine; }; calliper[] += out[1];
  wall = out[0];
  out[] = Extrude{0, 0, z_seal - z_bottom}{ Surface{wall}; Layers{n_one}; Recombine; }; calliper[] += out[1]; seal_bore[] += out[4];
  wall = out[0];
  out[] = Extrude{0, 0, z_mouth - z_seal}{ Surface{wall}; Layers{n_one}; Recombine; }; calliper[] += out[1];
EndFor
// The bridge above the housing, and two fingers from it.
bridge[] = {};
For i In {6:8}
  out[] = Extrude{0, bridge_top - centre_y - square, 0}{ Curve{line_out[i]}; Layers{n_one}; Recombine; };
  s = out[1];
  levels[] = {z_bottom - z_end, z_seal - z_bottom, z_mouth - z_seal, z_finger - z_mouth, z_tip - z_finger};
  layers[] = {n_one, n_one, n_one, n_three, n_one};
  For t In {0:4}
    out[] = Extrude{0, 0, levels[t]}{ Surface{s}; Layers{layers[t]}; Recombine; };
    calliper[] += out[1]; s = out[0];
  EndFor
  If (i != 7)
    low = i == 6 ? third : -square; high = i == 6 ? square : -third; e = 0.0001; y_top = centre_y + square;
    root[] = Surface In BoundingBox{low - e, y_top - e, z_finger - e, high + e, y_top + e, z_tip + e};
    out[] = Extrude{0, -0.054, 0}{ Surface{root[0]}; Layers{n_two}; Recombine; };
    calliper[] += out[1];
    finger[] += Surface In BoundingBox{low - e, y_top - 0.054 - e, z_finger - e, high + e, y_top + e, z_finger + e};
  EndIf
EndFor
// A lug on either side, with a guide pin.
pin_x = 0.080; pin_y = 0.116; z_pin = -0.030;
For end In {-1:1:2}
  If (end > 0)
    edge = line_out[4];
  Else
    edge = line_out[10];
  EndIf
  out[] = Extrude{end * (0.068 - square), 0, 0}{ Curve{edge}; Layers{n_one}; Recombine; };
  edge = out[0]; s = out[1];
  out[] = Extrude{0, 0, z_bottom - z_end}{ Surface{s}; Layers{n_one}; Recombine; }; calliper[] += out[1];
  out[] = Extrude{end * 0.024, 0, 0}{ Curve{edge}; Layers{n_one}; Recombine; };
  s = out[1];
  out[] = Extrude{0, 0, z_bottom - z_end}{ Surface{s}; Layers{n_one}; Recombine; }; calliper[] += out[1]; lug[] += out[0];
EndFor

// A round bar along z as one square in a ring of four quadrilaterals.
// Its centre bar_x, bar_y, z_from; its radius, and the share of it that the square has; surfaces core_face, ring_face[].
Macro Bar
  o = newp; Point(o) = {bar_x, bar_y, z_from};
  For i In {0:3}
    turn = (2 * i + 1) * Pi / 4;
    q = newp; Point(q) = {bar_x + radius * Cos(turn), bar_y + radius * Sin(turn), z_from}; round[i] = q;
    q = newp; Point(q) = {bar_x + share * radius * Cos(turn), bar_y + share * radius * Sin(turn), z_from}; inside[i] = q;
  EndFor
  For i In {0:3}
    t = (i + 1) % 4;
    c = newc; Circle(c) = {round[i], o, round[t]}; Transfinite Curve{c} = n_arc + 1; line_round[i] = c;
    c = newc; Circle(c) = {inside[i], o, inside[t]}; Transfinite Curve{c} = n_arc + 1; line_in[i] = c;
    c = newc; Line(c) = {round[i], inside[i]}; Transfinite Curve{c} = n_one + 1; spoke[i] = c;
  EndFor
  core_face = news; Curve Loop(core_face) = {line_in[{0:3}]}; Plane Surface(core_face) = {core_face}; Transfinite Surface{core_face};
  ring_face[] = {};
  For i In {0:3}
    t = (i + 1) % 4;
    s = news; Curve Loop(s) = {line_round[i], spoke[t], -line_in[i], -spoke[i]}; Plane Surface(s) = {s}; Transfinite Surface{s};
    ring_face[] += s;
  EndFor
Return

// The piston, a cup whose rim presses on the inner shim.
bar_x = 0; bar_y = centre_y; z_from = -0.060; radius = piston_radius - 0.0005; share = 0.7; n_arc = n_two;
Call Bar;
piston_base[] = {core_face, ring_face[]};
out[] = Extrude{0, 0, 0.008}{ Surface{core_face}; Layers{n_one}; Recombine; }; piston[] += out[1];
For i In {0:3}
  out[] = Extrude{0, 0, 0.008}{ Surface{ring_face[i]}; Layers{n_one}; Recombine; }; piston[] += out[1]; s = out[0];
  out[] = Extrude{0, 0, -z_finger + 0.052}{ Surface{s}; Layers{n_two}; Recombine; }; piston[] += out[1]; piston_rim[] += out[0];
EndFor

For end In {-1:1:2}
  bar_x = end * pin_x; bar_y = pin_y; z_from = z_bottom; radius = pin_radius; share = 0.5; n_arc = n_one;
  Call Bar;
  faces[] = {core_face, ring_face[]};
  pin_root[] += faces[];
  tip[] = {};
  For i In {0:4}
    out[] = Extrude{0, 0, z_pin - z_bottom}{ Surface{faces[i]}; Layers{n_three}; Recombine; }; pins[] += out[1]; tip[] += out[0];
  EndFor
  If (end < 0)
    tip_trailing[] = tip[];
  Else
    tip_leading[] = tip[];
  EndIf
EndFor

Physical Volume("disc") = disc[];
Physical Volume("linings") = linings[];
Physical Volume("plates") = plates[];
Physical Volume("shims") = shims[];
Physical Volume("bracket") = bracket[];
Physical Volume("calliper") = calliper[];
Physical Volume("piston") = piston[];
Physical Volume("pins") = pins[];
Physical Surface("hub") = hub[];
Physical Surface("disc_inner") = disc_inner[];
Physical Surface("disc_outer") = disc_outer[];
Physical Surface("lining_inner") = lining_face[0];
Physical Surface("lining_outer") = lining_face[1];
Physical Surface("plate_inner") = back[0];
Physical Surface("plate_outer") = back[1];
Physical Surface("clip_inner") = clip[0];
Physical Surface("clip_outer") = clip[1];
// tabs: the inner pad's trailing and leading one, then the outer pad's
Physical Surface("tab_inner_trailing") = tab_face[0];
Physical Surface("tab_inner_leading") = tab_face[1];
Physical Surface("tab_outer_trailing") = tab_face[2];
Physical Surface("tab_outer_leading") = tab_face[3];
Physical Surface("foot_inner") = {tab_ledge[0], tab_ledge[1]};
Physical Surface("foot_outer") = {tab_ledge[2], tab_ledge[3]};
Physical Surface("abutment_inner_trailing") = inner_abutment[0];
Physical Surface("abutment_inner_leading") = inner_abutment[1];
Physical Surface("abutment_outer_trailing") = outer_abutment[0];
Physical Surface("abutment_outer_leading") = outer_abutment[1];
Physical Surface("ledge_inner") = inner_ledge[];
Physical Surface("ledge_outer") = outer_ledge[];
Physical Surface("shim_inner_plate") = shim_plate[0];
Physical Surface("shim_outer_plate") = shim_plate[1];
Physical Surface("shim_inner_back") = shim_back[0];
Physical Surface("shim_outer_back") = shim_back[1];
Physical Surface("piston_rim") = piston_rim[];
Physical Surface("piston_base") = piston_base[];
Physical Surface("bore_bottom") = bore_bottom[];
Physical Surface("bore_seal") = seal_bore[];
Physical Surface("fingers") = finger[];
Physical Surface("mount") = mount[];
Physical Surface("lug") = lug[];
Physical Surface("pin_root") = pin_root[];
Physical Surface("tip_trailing") = tip_trailing[];
Physical Surface("tip_leading") = tip_leading[];
Physical Surface("sleeve_trailing") = sleeve[0];
Physical Surface("sleeve_leading") = sleeve[1];
