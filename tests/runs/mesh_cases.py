"""Structures whose eigenvalues are known exactly, on meshes of n divisions of each element type."""

import cmath
import math

SECOND_ORDER = "Mesh.ElementOrder = 2; Mesh.SecondOrderIncomplete = 1;"
ELEMENTS = {"hex8": ("Recombine Surface{:};", "Recombine;", ""), "hex20": ("Recombine Surface{:};", "Recombine;", SECOND_ORDER),
            "wedge6": ("", "Recombine;", ""), "hex27": ("Recombine Surface{:};", "Recombine;", "Mesh.ElementOrder = 2;"),
            "wedge15": ("", "Recombine;", SECOND_ORDER), "tet4": ("", "", ""), "tet10": ("", "", SECOND_ORDER)}

BAR = """
n = {n};
Point(1) = {{0, 0, 0}}; Point(2) = {{0, 0.2, 0}}; Point(3) = {{0, 0.2, 0.2}}; Point(4) = {{0, 0, 0.2}};
Line(1) = {{1, 2}}; Line(2) = {{2, 3}}; Line(3) = {{3, 4}}; Line(4) = {{4, 1}};
Transfinite Curve{{1, 2, 3, 4}} = 2;
Curve Loop(1) = {{1, 2, 3, 4}}; Plane Surface(1) = {{1}}; Transfinite Surface{{1}}; {surface}
out[] = Extrude {{1, 0, 0}} {{ Surface{{1}}; Layers{{n}}; {layers} }};
Physical Volume("bar") = {{out[1]}}; Physical Surface("end") = {{1}};
Physical Surface("y") = {{out[3], out[5]}}; Physical Surface("z") = {{out[2], out[4]}};
{order}
"""
BAR_SCENE = """
mesh = { file = "mesh.geo" }
part = [ { name = "bar", young = 1e9, poisson = 0, density = 1000 } ]
support = [ { on = "end", fixed = "x" }, { on = "y", fixed = "y" }, { on = "z", fixed = "z" } ]
damping = { beta = 1e-6 }
modes = { band = 400 }
"""

# A plate of unit length and a tenth of it high, in bending; its sides do not move along z.
CANTILEVER = BAR.replace("0.2,", "0.1,").replace("0.2}", "0.1}").replace("Layers{{n}}", "Layers{{4 * n}}")
CANTILEVER_SCENE = """
mesh = { file = "mesh.geo" }
part = [ { name = "bar", young = 1e9, poisson = 0, density = 1000 } ]
support = [ { on = "end", fixed = "all" }, { on = "z", fixed = "z" } ]
damping = { beta = 1e-5 }
modes = { band = 80 }
"""

# A quarter of the upper half of a free thick ring: its sides and lower face hold what vanishes there in bending with two nodal
# diameters, sin 2 theta.
RING = """
n = {n};
For j In {{0:4}}
  Point(2 * j + 1) = {{0.145 * Cos(j * Pi / 8), 0.145 * Sin(j * Pi / 8), 0}};
  Point(2 * j + 2) = {{0.32 * Cos(j * Pi / 8), 0.32 * Sin(j * Pi / 8), 0}};
  Line(j + 1) = {{2 * j + 1, 2 * j + 2}};
EndFor
Point(100) = {{0, 0, 0}};
For j In {{0:3}}
  Circle(10 + j) = {{2 * j + 1, 100, 2 * j + 3}}; Circle(20 + j) = {{2 * j + 2, 100, 2 * j + 4}};
  Transfinite Curve{{10 + j, 20 + j}} = n + 1;
  Curve Loop(j + 1) = {{j + 1, 20 + j, -(j + 2), -(10 + j)}}; Plane Surface(j + 1) = {{j + 1}};
EndFor
Transfinite Curve{{1, 2, 3, 4, 5}} = 2 * n + 1;
Transfinite Surface{{:}}; {surface}
volumes[] = {{}};
For j In {{1:4}}
  out[] = Extrude {{0, 0, 0.0225}} {{ Surface{{j}}; Layers{{n}}; {layers} }};
  volumes[] += out[1];
  If (j == 1)
    first = out[2];
  EndIf
EndFor
Physical Volume("ring") = volumes[]; Physical Surface("middle") = {{1, 2, 3, 4}};
Physical Surface("y") = {{first}}; Physical Surface("x") = {{out[4]}};
{order}
"""
RING_SCENE = """
mesh = { file = "mesh.geo" }
part = [ { name = "ring", young = 210e9, poisson = 0.3, density = 7850 } ]
support = [ { on = "middle", fixed = "x y" }, { on = "y", fixed = "x z" }, { on = "x", fixed = "y z" } ]
damping = { beta = 1e-6 }
modes = { band = 2000 }
"""

# Two bars that friction couples: a block rubs on the end of one, along the other. A spring across joins both of its motions.
PAIR = """
n = {n};
Point(1) = {{0, 0, 0}}; Point(2) = {{0, 0.2, 0}}; Point(3) = {{0, 0.2, 0.2}}; Point(4) = {{0, 0, 0.2}};
Line(1) = {{1, 2}}; Line(2) = {{2, 3}}; Line(3) = {{3, 4}}; Line(4) = {{4, 1}};
Curve Loop(1) = {{1, 2, 3, 4}}; Plane Surface(1) = {{1}};
other[] = Translate {{5, 0, 0}} {{ Duplicata {{ Surface{{1}}; }} }};
Rotate {{{{0, 0, 1}}, {{5, 0, 0}}, Pi / 2}} {{ Surface{{other[0]}}; }}
Transfinite Curve{{:}} = 2; Transfinite Surface{{:}}; {surface}
one[] = Extrude {{1, 0, 0}} {{ Surface{{1}}; Layers{{n}}; {layers} }};
two[] = Extrude {{0, 1, 0}} {{ Surface{{other[0]}}; Layers{{n}}; {layers} }};
Physical Volume("one") = {{one[1]}}; Physical Volume("two") = {{two[1]}};
Physical Surface("root_one") = {{1}}; Physical Surface("root_two") = {{other[0]}};
Physical Surface("tip_one") = {{one[0]}}; Physical Surface("tip_two") = {{two[0]}};
Physical Surface("y_one") = {{one[3], one[5]}}; Physical Surface("x_two") = {{two[3], two[5]}};
Physical Surface("z") = {{one[2], one[4], two[2], two[4]}};
{order}
"""
YOUNG, DENSITY, AREA, BLOCK, JOINT, ACROSS, FRICTION = (1e9, 1.02e9), 1000.0, 0.04, 20.0, 2e9, 1e7, 0.5
PAIR_SCENE = f"""
mesh = {{ file = "mesh.geo" }}
part = [ {{ name = "one", young = {YOUNG[0]}, poisson = 0, density = {DENSITY} }},
         {{ name = "two", young = {YOUNG[1]}, poisson = 0, density = {DENSITY} }} ]
support = [ {{ on = "root_one", fixed = "x" }}, {{ on = "root_two", fixed = "y" }}, {{ on = "y_one", fixed = "y" }},
            {{ on = "x_two", fixed = "x" }}, {{ on = "z", fixed = "z" }} ]
point = [ {{ name = "block", at = [1, 0, 0], mass = {BLOCK}, free = "x y" }}, {{ name = "belt", at = [1, 0, 0], free = "x" }} ]
rigid_body = [ {{ name = "one_end", surfaces = "tip_one", at = [1, 0, 0], free = "x", motions = "x" }},
               {{ name = "two_end", surfaces = "tip_two", at = [5, 1, 0], free = "y", motions = "y" }} ]
spring = [ {{ from = "belt", to = "one_end", direction = "x", stiffness = {JOINT} }},
           {{ from = "block", to = "two_end", direction = "y", stiffness = {JOINT} }},
           {{ from = "block", to = "ground", direction = [1, 1, 0], stiffness = {ACROSS} }} ]
force = [ {{ on = "block", vector = [-1000, 0, 0] }} ]
contact = [ {{ rotor = "belt", stator = "block", normal = "x", tangents = [[0, 1, 0]], velocity = [0, -1, 0] }} ]
friction = {{ coefficient = {FRICTION} }}
modes = {{ band = 400 }}
estimate = {{ enabled = false }}
"""


def damped(frequency_hz, beta):
    """Growth rate and frequency of a mode with C = beta K, by that without."""
    omega = 2 * math.pi * frequency_hz
    return complex(-beta * omega**2 / 2, omega * math.sqrt(1 - (beta * omega / 2)**2))


def exact_pair():
    """The root near 183 Hz of det [[m s^2 + k/2 + k_2, k/2 - mu k_1], [k/2, m s^2 + k/2 + k_1]] by Newton's method, with the dynamic
    stiffnesses k_i = E A q/tanh(q L), q = s sqrt(rho/E), of the bars' ends in series with the joints."""
    def end(s, young):
        q = s * math.sqrt(DENSITY / young)
        return 1 / (1 / JOINT + cmath.tanh(q) / (young * AREA * q))

    def determinant(s):
        one, two = (end(s, young) for young in YOUNG)
        own = BLOCK * s * s + ACROSS / 2
        return (own + two) * (own + one) - (ACROSS / 2 - FRICTION * one) * ACROSS / 2

    s, h = complex(60, 2 * math.pi * 183), 1e-3
    for _ in range(40):
        s -= determinant(s) * 2 * h / (determinant(s + h) - determinant(s - h))
    return s


# The cantilever's is the limit of 20-node bricks, 1e-5 above that of Timoshenko's beam; the ring's is of three-dimensional elasticity.
CASES = {"clamped bar": (BAR, BAR_SCENE, damped(250, 1e-6)), "cantilever": (CANTILEVER, CANTILEVER_SCENE, damped(16.0491, 1e-5)),
         "thick ring": (RING, RING_SCENE, damped(467.3769, 1e-6)), "flutter pair": (PAIR, PAIR_SCENE, exact_pair())}


def write_case(folder, case, element, n):
    """Writes scene.toml and its geometry; returns the exact eigenvalue."""
    geometry, scene, exact = CASES[case]
    surface, layers, order = ELEMENTS[element]
    (folder / "mesh.geo").write_text(geometry.format(n=n, surface=surface, layers=layers, order=order))
    (folder / "scene.toml").write_text(scene)
    return exact
