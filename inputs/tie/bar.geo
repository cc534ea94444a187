// Two blocks whose meshes do not match, end to end along x. Metres.
DefineConstant[ divisions = {2, Min 1, Step 1, Name "Mesh/elements across the left block"} ];
Mesh.ElementOrder = 1;
side = 0.02;
length[] = {0.1, 0.1};
n[] = {divisions, Ceil(1.5 * divisions)};
For k In {0:1}
  x = k * 1.0; // apart, so that they share no nodes
  p = newp; Point(p) = {x, 0, 0}; Point(p + 1) = {x, side, 0}; Point(p + 2) = {x, side, side}; Point(p + 3) = {x, 0, side};
  c = newc; Line(c) = {p, p + 1}; Line(c + 1) = {p + 1, p + 2}; Line(c + 2) = {p + 2, p + 3}; Line(c + 3) = {p + 3, p};
  s = news; Curve Loop(s) = {c, c + 1, c + 2, c + 3}; Plane Surface(s) = {s};
  Transfinite Curve{c, c + 1, c + 2, c + 3} = n[k] + 1; Transfinite Surface{s}; Recombine Surface{s};
  block[] = Extrude {length[k], 0, 0} { Surface{s}; Layers{5 * n[k]}; Recombine; };
  volume[k] = block[1]; low[k] = s; high[k] = block[0];
EndFor
Geometry.AutoCoherence = 0;
Translate {length[0] - 1.0, 0, 0} { Volume{volume[1]}; }
Physical Volume("left") = volume[0];
Physical Volume("right") = volume[1];
Physical Surface("root") = low[0];
Physical Surface("left_end") = high[0];
Physical Surface("right_end") = low[1];
Physical Surface("tip") = high[1];
