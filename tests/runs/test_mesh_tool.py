"""tools/mesh: decks of other codes give the eigenvalues of the same mesh in gmsh's format, and skeletons that squeal reads."""

import sys
import tomllib

import numpy as np
import pytest
from conftest import load_tool
from models import KINDS, PYRAMIDS, STEEL, WEDGES, WHOLE, Mesh, bricks, bricks20, cells_of, lattice, tetrahedra10, write_scene

KINDS.setdefault("tet10", (11, 3))
LINING = {"young": 5e9, "poisson": 0.25, "density": 2500}
# Where the other code's nodes stand in gmsh's order, as these codes' manuals draw them.
ORDERS = {
    "abaqus": {"brick20": [*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15], "tet10": [*range(8), 9, 8],
               "brick27": [*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 26, 20, 25, 21, 23, 24, 22],
               "wedge15": [*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11]},
    "nastran": {"brick20": [*range(8), 8, 11, 13, 9, 10, 12, 14, 15, 16, 18, 19, 17], "tet10": [*range(8), 9, 8],
                "wedge15": [*range(6), 6, 9, 7, 8, 10, 11, 12, 14, 13], "pyramid13": [*range(5), 5, 8, 10, 6, 7, 9, 11, 12]},
}

TOOL = load_tool("mesh")
MOTIONS = ("x", "y", "z", "rx", "ry", "rz")


class TwoBlocks:
    """A plate with a pad on it: nodes, solids of each part in gmsh's order, and sets of nodes. The pad's side is bent, so that
    a wrong order of nodes is another body."""

    def __init__(self, kind):
        self.kind, self.mesh = kind, Mesh()
        double = {"brick": 1, "brick20": 2, "tet10": 2}.get(kind, 4)
        size = {"plate": ((3, 1, 1), (0.06, 0.04, 0.01), 0.0), "pad": ((2, 1, 1), (0.04, 0.04, 0.012), 0.01)}
        self.cells, self.sets = {}, {}
        make = {"brick": bricks, "brick20": bricks20, "tet10": tetrahedra10}.get(kind) or (
            lambda nodes: cells_of(kind, {"brick27": WHOLE, "wedge15": WEDGES, "pyramid13": PYRAMIDS}[kind], nodes))
        for name, (divisions, (a, b, c), z) in size.items():
            nodes = self.mesh.add_nodes(lattice([double * n for n in divisions],
                                                lambda x, y, t: (a * x + 0.004 * t * y, b * y, z + c * t)))
            self.cells[name] = make(nodes)
            used = set(np.ravel(self.cells[name]).tolist())
            for side, part in (("clamp", nodes[0]), ("bottom", nodes[:, :, 0]), ("top", nodes[:, :, -1])):
                self.sets[f"{name}_{side}"] = sorted(used & set(part.ravel().tolist()))

    def faces(self, name):
        """Corner and mid-side nodes of the element faces in a set, gmsh's order."""
        wanted, found = set(self.sets[name]), []
        corners = {"tet10": 4, "wedge15": 6, "pyramid13": 5}.get(self.kind, 8)
        for cell in self.cells[name.split("_")[0]]:
            inside = [n for n in cell[:corners] if n in wanted]
            if len(inside) == (3 if corners in (4, 6) else 4):
                found.append((cell, inside))
        return found

    def write_gmsh(self, file):
        """Faces are found by their places, not by the tool."""
        at = np.array(self.mesh.nodes)
        for name, cells in self.cells.items():
            self.mesh.add(name, self.kind, cells)
        for name in ("plate_top", "pad_bottom", "pad_top"):
            for cell, inside in self.faces(name):
                centre = at[inside].mean(axis=0)
                around = sorted(inside, key=lambda n: np.arctan2(*(at[n] - centre)[[1, 0]]))
                middle = []
                if self.kind != "brick":
                    for a, b in zip(around, around[1:] + around[:1]):
                        middle.append(min(cell, key=lambda n: np.linalg.norm(at[n] - (at[a] + at[b]) / 2)))
                if self.kind == "brick27":
                    middle.append(min(cell, key=lambda n: np.linalg.norm(at[n] - centre)))
                self.mesh.add(name, {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}[len(around + middle)], [around + middle])
        self.mesh.add_points("plate_clamp", self.sets["plate_clamp"])
        self.mesh.write(file)

    def write_inp(self, file):
        """Two sections, sets over several lines and generated, a surface by faces, one by a set of nodes."""
        kind = {"brick": "C3D8", "brick20": "C3D20R", "tet10": "C3D10M", "brick27": "C3D27", "wedge15": "C3D15"}[self.kind]
        order = ORDERS["abaqus"].get(self.kind, list(range(8)))
        text = "*HEADING\n two blocks\n*NODE\n"
        text += "".join(f"{i + 1}, {x:.17g}, {y:.17g}, {z:.17g}\n" for i, (x, y, z) in enumerate(self.mesh.nodes))
        number = 0
        for name, cells in self.cells.items():
            text += f"*Element, type={kind}, elset={name}\n"
            for cell in cells:
                number += 1
                fields = [number, *(cell[order] + 1)]
                text += ", ".join(map(str, fields[:14])) + (",\n" + ", ".join(map(str, fields[14:])) if fields[14:] else "") + "\n"
        for name, nodes in self.sets.items():
            rows = [nodes[i : i + 9] for i in range(0, len(nodes), 9)]
            text += f"*NSET, NSET={name}\n" + "\n".join(", ".join(str(n + 1) for n in row) + "," for row in rows) + "\n"
        text += f"*ELSET, ELSET=everything, GENERATE\n1, {number}, 1\n"
        for name, stuff in (("plate", STEEL), ("pad", LINING)):
            text += f"*MATERIAL, NAME=of_{name}\n*ELASTIC\n{stuff['young']:g}, {stuff['poisson']}\n*DENSITY\n{stuff['density']}\n"
            text += f"*SOLID SECTION, ELSET={name.upper()}, MATERIAL=OF_{name.upper()}\n"
        if self.kind in ("brick", "brick20", "brick27"):
            text += "*SURFACE, NAME=upper\nplate, S2\n"
        text += "*BOUNDARY\nplate_clamp, ENCASTRE\npad_top, 1, 2\n"
        file.write_text(text)

    def write_parts(self, file):
        """Each body a part with numbers of its own, written shifted and turned; instances put both in place."""
        kind, order = {"brick": "C3D8", "brick20": "C3D20", "tet10": "C3D10"}[self.kind], ORDERS["abaqus"].get(self.kind, list(range(8)))
        text, assembly = "*HEADING\n two parts\n", "*ASSEMBLY, NAME=all\n"
        for name, cells in self.cells.items():
            used = np.unique(cells)
            local = {n: i + 1 for i, n in enumerate(used)}
            at = np.array(self.mesh.nodes)[used] - (0.03, 0.01, 0.02)
            at = at @ np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])  # by -90 degrees about z
            text += f"*PART, NAME={name}-part\n*NODE\n" + "".join(f"{i}, {x:.17g}, {y:.17g}, {z:.17g}\n" for i, (x, y, z) in enumerate(at, 1))
            text += f"*ELEMENT, TYPE={kind}\n"
            for number, cell in enumerate(cells, 1):
                fields = [number, *(local[n] for n in cell[order])]
                text += ", ".join(map(str, fields[:14])) + (",\n" + ", ".join(map(str, fields[14:])) if fields[14:] else "") + "\n"
            text += f"*ELSET, ELSET=all, GENERATE\n1, {len(cells)}, 1\n*NSET, NSET=top\n"
            text += "".join(f"{local[n]}\n" for n in self.sets[f"{name}_top"])
            text += f"*SOLID SECTION, ELSET=all, MATERIAL=of_{name}\n,\n*END PART\n"
            # Abaqus shifts first: the turn about the line through the shift is the inverse of the one above
            assembly += f"*INSTANCE, NAME={name}-1, PART={name}-part\n0.03, 0.01, 0.02\n0.03, 0.01, 0., 0.03, 0.01, 1., 90.\n*END INSTANCE\n"
            for side in ("bottom", "clamp"):
                assembly += f"*NSET, NSET={name}_{side}, INSTANCE={name}-1\n" + "".join(f"{local[n]}\n" for n in self.sets[f"{name}_{side}"])
        assembly += "*NSET, NSET=upper\nplate-1.top\n*END ASSEMBLY\n"
        for name, stuff in (("plate", STEEL), ("pad", LINING)):
            assembly += f"*MATERIAL, NAME=of_{name}\n*ELASTIC\n{stuff['young']:g}, {stuff['poisson']}\n*DENSITY\n{stuff['density']}\n"
        file.write_text(text + assembly + "*BOUNDARY\nplate_clamp, ENCASTRE\npad-1.top, 1, 2\n")

    def write_bdf(self, file):
        """Small, large and free fields, continuations, lists with THRU."""
        name_of = {"brick": "CHEXA", "brick20": "CHEXA", "tet10": "CTETRA", "wedge15": "CPENTA", "pyramid13": "CPYRAM"}[self.kind]
        order = ORDERS["nastran"].get(self.kind, list(range(8)))
        lines = ["SOL 103", "CEND", "BEGIN BULK", "$HMNAME PROP           1\"plate\" 4", "$HMNAME PROP           2\"pad\" 4"]
        for i, (x, y, z) in enumerate(self.mesh.nodes, 1):
            lines += [f"{'GRID*':8}{i:16d}{'':16}{x:16.10f}{y:16.10f}", f"{'*':8}{z:16.10f}"]
        number = 0
        for pid, cells in enumerate(self.cells.values(), 1):
            for cell in cells:
                number += 1
                fields = [number, pid, *(cell[order] + 1)]
                if pid == 1:
                    for i in range(0, len(fields), 8):
                        lines.append((f"{name_of:8}" if i == 0 else f"{'+':8}") + "".join(f"{f:8d}" for f in fields[i : i + 8]))
                else:
                    rows = [fields[i : i + 8] for i in range(0, len(fields), 8)]
                    lines.append(f"{name_of}," + ",\n,".join(",".join(map(str, row)) for row in rows))
        for pid, stuff in enumerate((STEEL, LINING), 1):
            young = f"{stuff['young']:.4e}".replace("e+0", "+").replace("e+", "+")  # Nastran's exponents have no letter
            lines += [f"PSOLID,{pid},{pid}", f"MAT1,{pid},{young},,{stuff['poisson']},{stuff['density']:.1f}"]
        for number, name in enumerate(("plate_top", "pad_bottom", "pad_top"), 11):
            nodes = [n + 1 for n in self.sets[name]]
            rows = [["SET1", str(number), *map(str, nodes[:7])]] + [["", *map(str, nodes[i : i + 8])] for i in range(7, len(nodes), 8)]
            lines += [",".join(row) for row in rows]
        lines += [",".join(["SPC1", "5", "123456", *(str(n + 1) for n in row)]) for row in np.array_split(self.sets["plate_clamp"], 5)]
        lines += [",".join(["SPC1", "5", "12", *(str(n + 1) for n in row)]) for row in np.array_split(self.sets["pad_top"], 6)]
        file.write_text("\n".join([*lines, "ENDDATA", ""]))


PHYSICS = {"friction": {"coefficient": 0.4}, "modes": {"method": "full", "band": 20000}, "estimate": {"enabled": False}}


def contact(rotor, stator, top):
    return {"pressure": [{"on": top, "value": 1e6}], "contact": [{"rotor": rotor, "stator": stator, "velocity": [1, 0, 0]}]}


def eigenvalues(report):
    assert report["model"]["pairs"] > 0 and len(report["modes"]["modes"]) > 3
    found = [complex(m["growth_rate"], 2 * np.pi * m["frequency_hz"]) for m in report["modes"]["modes"]]
    return np.array(sorted(found, key=lambda value: value.imag))


@pytest.fixture(scope="module")
def expected(module_run, tmp_path_factory):
    """Eigenvalues of the two blocks as gmsh reads them."""
    known = {}

    def of(kind):
        if kind not in known:
            folder = tmp_path_factory.mktemp(kind)
            TwoBlocks(kind).write_gmsh(folder / "mesh.msh")
            parts = [{"name": "plate", **STEEL}, {"name": "pad", **LINING}]
            support = [{"on": "plate_clamp", "fixed": "all"}, {"on": "pad_top", "fixed": "x y"}]
            scene = write_scene(folder, mesh={"file": "mesh.msh"}, part=parts, support=support, **PHYSICS,
                                **contact("plate_top", "pad_bottom", "pad_top"))
            known[kind] = eigenvalues(module_run(scene, ranks=1))
        return known[kind]

    return of


def convert(deck, folder, *words):
    old = sys.argv
    sys.argv = ["mesh", str(deck), str(folder), *words]
    try:
        TOOL.main()
    finally:
        sys.argv = old
    return folder / "scene.toml"


def completed(scene, names):
    """The scene with a contact and what acts on it, which these decks do not have."""
    text = scene.read_text()
    assert "FILL IN [" not in text and "[[contact]]" not in text
    extra = write_scene(scene.parent.parent, **contact(*names)).read_text()
    scene.write_text(text + extra + '\n[friction]\ncoefficient = 0.4\n\n[modes]\nmethod = "full"\nband = 20000\n\n[estimate]\nenabled = false\n')
    return scene


@pytest.mark.parametrize("kind, code", [("brick", "abaqus"), ("brick", "nastran"), *((kind, code) for code in ORDERS for kind in ORDERS[code])])
def test_decks_have_the_eigenvalues_of_the_mesh(module_run, expected, tmp_path, kind, code):
    """Orders of nodes, sets, sections, materials and supports: any slip gives other eigenvalues. Nastran's fields have ten
    decimals, which hold these positions."""
    blocks = TwoBlocks(kind)
    deck = tmp_path / ("two.inp" if code == "abaqus" else "two.bdf")
    blocks.write_inp(deck) if code == "abaqus" else blocks.write_bdf(deck)
    scene = convert(deck, tmp_path / "out")
    upper = "upper" if kind.startswith("brick") else "plate_top"
    names = (upper, "pad_bottom", "pad_top") if code == "abaqus" else ("set_11", "set_12", "set_13")
    found = eigenvalues(module_run(completed(scene, names), ranks=1))
    np.testing.assert_allclose(found, expected(kind), rtol=1e-10)


def test_parts_and_instances_have_the_eigenvalues_of_the_mesh(module_run, expected, tmp_path):
    """Two parts with the same numbers and the same names of sets, in other places than their instances."""
    TwoBlocks("brick20").write_parts(tmp_path / "two.inp")
    scene = convert(tmp_path / "two.inp", tmp_path / "out")
    text = scene.read_text()
    assert '"plate-1_all"' in text and '"pad-1_all"' in text
    found = eigenvalues(module_run(completed(scene, ("upper", "pad_bottom", "pad-1_top")), ranks=1))
    np.testing.assert_allclose(found, expected("brick20"), rtol=1e-10)


def test_nodes_of_local_coordinate_systems(tmp_path):
    """A cube of edge 1 at (1, 2, 3), turned by 90 degrees about z: one node in each kind of system, systems in systems."""
    (tmp_path / "a.bdf").write_text(
        "CORD2R,7,,1.,2.,3.,1.,2.,4.\n,1.,3.,3.\nCORD2C,8,7,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nCORD2S,9,0,0.,0.,1.,0.,0.,2.\n,1.,0.,1.\n"
        "GRDSET,,7\nGRID,1,,0.,0.,0.\nGRID,2,7,1.,0.,0.\nGRID,3,8,1.,90.,2.\nGRID,4,9,2.,90.,180.\nGRID,5,0,1.,1.,1.\nCTRIA3,1,1,1,2,3\n")
    nodes = TOOL.read_deck(tmp_path / "a.bdf").nodes
    for number, at in {1: (1, 2, 3), 2: (1, 3, 3), 3: (0, 2, 5), 4: (-2, 0, 1), 5: (1, 1, 1)}.items():
        assert np.allclose(nodes[number], at, rtol=0, atol=1e-15), number


@pytest.mark.parametrize("ending", ["vtu", "vtk", "med", "xdmf"])
def test_meshio_formats_keep_volumes_and_groups(tmp_path, ending):
    """Volumes by the divergence theorem, to rounding, of every element in gmsh's order; groups as far as a format has them."""
    meshio = pytest.importorskip("meshio")
    blocks = TwoBlocks("brick20")
    order = ORDERS["abaqus"]["brick20"]  # VTK's too
    cells = [("hexahedron20", np.concatenate([blocks.cells[name][:, order] for name in ("plate", "pad")]))]
    tags = np.repeat([1, 2], [len(blocks.cells[name]) for name in ("plate", "pad")])
    mesh = meshio.Mesh(np.array(blocks.mesh.nodes), cells, cell_data={"part": [tags]})
    if ending == "med":
        mesh = meshio.Mesh(mesh.points, cells, cell_data={"cell_tags": [-tags]})
        mesh.cell_tags = {-1: ["plate"], -2: ["pad"]}
    meshio.write(tmp_path / f"two.{ending}", mesh)
    scene = tomllib.loads(convert(tmp_path / f"two.{ending}", tmp_path / "out").read_text())
    names = sorted(part["name"] for part in scene["part"])
    assert names == (["pad", "plate"] if ending == "med" else ["part_1", "part_2"])
    model = TOOL.read_deck(tmp_path / f"two.{ending}")
    gmsh = {frozenset(cell): cell for part in blocks.cells.values() for cell in (part + 1).tolist()}
    ours = [nodes for _, nodes in model.elements.values()]
    assert len(ours) == 5 and all(list(nodes) == gmsh[frozenset(nodes)] for nodes in ours)
    assert np.allclose([model.nodes[n] for n in ours[0]], np.array(blocks.mesh.nodes)[[n - 1 for n in ours[0]]], rtol=1e-15)


def test_shells_units_and_what_is_missing(squeal, tmp_path):
    """A deck in mm, N and t: SI in the scene. What the deck lacks is a comment, and squeal names it."""
    text = "*NODE\n1,0,0,0\n2,10,0,0\n3,10,10,0\n4,0,10,0\n*ELEMENT, TYPE=S4R, ELSET=skin\n5,1,2,3,4\n*NSET, NSET=edge\n1,4\n"
    text += "*MATERIAL, NAME=steel\n*ELASTIC\n210000., 0.3\n*DENSITY\n7.85e-9\n*SHELL SECTION, ELSET=skin, MATERIAL=steel\n2.,5\n"
    (tmp_path / "shell.inp").write_text(text + "*BOUNDARY\nedge, 1, 6\n*CLOAD\n2, 3, 4.\n*TEMPERATURE\n2, 3.\n")
    scene = convert(tmp_path / "shell.inp", tmp_path / "out", "--length", "0.001")
    content = tomllib.loads(scene.read_text())
    assert content["part"] == [{"name": "skin", "young": 210e9, "poisson": 0.3, "density": 7850, "thickness": 0.002}]
    assert content["support"] == [{"on": "edge", "fixed": "all"}] and content["mesh"]["scale"] == 0.001
    assert content["force"] == [{"on": "node_2", "vector": [0, 0, 4]}]
    assert "*TEMPERATURE (line 21)" in scene.read_text()
    (tmp_path / "shell.inp").write_text(text.replace("210000., 0.3\n*DENSITY", "210000., 0.3\n*EXPANSION").replace("7.85e-9", "1e-5"))
    scene = convert(tmp_path / "shell.inp", tmp_path / "lacks", "--length", "1")
    assert 'density = "FILL IN [kg/m3]: the deck has none"' in scene.read_text()
    assert "density" in squeal(scene, "--dry-run", ranks=1).messages[0]


CUBE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
TOP, RIGHT = frozenset((5, 6, 7, 8)), frozenset((2, 3, 7, 6))


def test_all_that_an_input_deck_may_name(tmp_path):
    """A brick of two sets: skins, faces by element and by set, generated sets, a tie, a contact pair, springs, a reference node."""
    (tmp_path / "nodes.inc").write_text("*NODE, NSET=All\n" + "".join(f"{i}, {x}, {y}, {z}\n" for i, (x, y, z) in enumerate(CUBE, 1)))
    (tmp_path / "deck.inp").write_text(
        "** a comment\n*INCLUDE, INPUT=nodes.inc\n*NODE\n99, 5., 5., 5.\n*ELEMENT, TYPE=C3D8R, ELSET=Body\n1, 1,2,3,4,5,6,\n7,8\n"
        "*ELEMENT, TYPE=SFM3D4, ELSET=Skin\n2, 5,6,7,8\n*ELEMENT, TYPE=SPRINGA, ELSET=wire\n3, 1, 2\n*NSET, NSET=Right, GENERATE\n"
        "2, 3, 1\n*NSET, NSET=Right\n6, 7\n*NSET, NSET=both\nRIGHT, 1\n*NSET, NSET=of_body, ELSET=BODY\n*NSET, NSET=ref\n99\n"
        "*SURFACE, NAME=side\nBody, S4\n*SURFACE, NAME=hull, TYPE=ELEMENT\nBODY\n*SURFACE, NAME=dots, TYPE=NODE\nRight\n"
        "*MATERIAL, NAME=Steel\n*ELASTIC, TYPE=LAMINA\n1,1,1\n*SOLID SECTION, ELSET=Body, MATERIAL=STEEL\n"
        "*TIE, NAME=t\nside, hull\n*SURFACE INTERACTION, NAME=i\n*CONTACT PAIR, INTERACTION=i\nSkin, side\n*BOUNDARY\n1, ZSYMM\nref, 1, 6\nRight, 2, 2, 0.1\n")
    model = TOOL.read_deck(tmp_path / "deck.inp")
    assert {name: {frozenset(f) for f in faces} for name, faces in model.surfaces.items() if name != "hull" and name != "of_body"} == {
        "side": {RIGHT}, "Skin": {TOP}, "Right": {RIGHT}, "dots": {RIGHT}, "both_faces": {RIGHT},
        "All": {frozenset(f) for f in model.faces(1)}}
    assert len(model.surfaces["hull"]) == len(model.surfaces["of_body"]) == 6
    assert model.node_sets == {"both": [2, 3, 6, 7, 1], "node_1": [1]}  # the others are the nodes of their surfaces
    assert model.supports == [("node_1", ["z", "rx", "ry"], {}), ("Right", ["y"], {"displacement": [0, 0.1, 0]})]
    text = convert(tmp_path / "deck.inp", tmp_path / "out").read_text()
    for words in ('[[tie]]\nslave = "side"\nmaster = "hull"', "[[contact]]\nrotor = \"side\"\nstator = \"Skin\"\nfriction = 0\n",
                  "1 element of type SPRINGA", "the set ref", "fixed = \"y\"\ndisplacement = [0, 0.1, 0]",
                  "*ELASTIC, TYPE=LAMINA", "young = \"FILL IN [Pa]: the deck has none\""):
        assert words in text, words


def test_all_that_bulk_data_may_name(tmp_path):
    """Skins of solids are surfaces, other flat elements are shells; every way to a set and to a support."""
    grids = "".join(f"GRID,{i},,{x}.,{y}.,{z}.{',,12' if i == 4 else ''}\n" for i, (x, y, z) in enumerate(CUBE, 1))
    (tmp_path / "more.bdf").write_text("CQUAD4,2,20,5,6,7,8\nCQUAD4,3,30,2,3,11,10\nPSHELL,30,7,0.002\nPSHELL,20,7,0.001\n")
    (tmp_path / "deck.bdf").write_text(
        "SET 4 = 2, 3,\n 6 THRU 7\nSET 5 = ALL\nBEGIN BULK\n" + grids + "GRID*                 10                              2.              0.\n"
        "*                     0.\nGRID,11,,2.,1.,0.\nCHEXA,1,10,1,2,3,4,5,6\n,7,8\n$ANSA_NAME_COMMENT;10;PSOLID;caliper;\nPSOLID,10,7\n"
        "MAT1,8,2.1+11,7.+10\nMAT1,7,2.1+11,,.3,7850.\nSPC1,1,3,1,THRU,4\nSPC,2,10,13,0.,11,2,0.\nSET3,6,ELEM,1,2\n"
        "RBE2,50,1,123,2\n"
        "INCLUDE 'more.bdf'\nENDDATA\nnothing more\n")
    model = TOOL.read_deck(tmp_path / "deck.bdf")
    assert list(model.parts) == ["caliper", "property_30"] and model.parts["property_30"].thickness == 0.002
    surfaces = {name: {frozenset(face) for face in faces} for name, faces in model.surfaces.items()}
    assert surfaces == {"property_20": {TOP}, "set_4": {RIGHT}, "set_6": {TOP}, "spc_1_3": {frozenset((1, 2, 3, 4))}}
    assert model.element_sets == {"set_6_elements": [1]}
    assert model.node_sets == {"spc_grid_12": [4], "spc_2_13": [10], "spc_2_2": [11], "rbe2_50": [2]}
    assert held(model) == {"spc_grid_12": ["x", "y"], "spc_1_3": ["z"], "spc_2_13": ["x", "z"], "spc_2_2": ["y"]}
    assert model.materials["7"] == {"young": 2.1e11, "poisson": 0.3, "density": 7850, "loss_factor": 0}
    assert model.materials["8"]["poisson"] == pytest.approx(0.5, rel=1e-15)


BULK = "".join(f"GRID,{i},,{x}.,{y}.,{z}.\n" for i, (x, y, z) in enumerate(CUBE, 1))
BULK += "CHEXA,1,10,1,2,3,4,5,6\n,7,8\nPSOLID,10,7\n"


def test_the_case_control_selects_supports(tmp_path):
    spc = "SPC1,1,3,1,2\nSPC1,2,1,3\nSPC1,3,2,4\nSPCADD,9,1,3\n"
    model = read_text(tmp_path, "SUBCASE 1\n  spc = 9\nBEGIN BULK\n" + spc + BULK, "a.bdf")
    assert held(model) == {"spc_1_3": ["z"], "spc_3_2": ["y"]}
    assert model.notes == ["SPC 2, which the case control does not select"]
    model = read_text(tmp_path, "BEGIN BULK\n" + spc + BULK, "a.bdf")
    assert len(model.supports) == 3
    assert model.notes == ["a choice of supports in the case control: all are there, SPC 1, 2, 3"]
    with pytest.raises(TOOL.Problem, match="case control, SPC: the set '7' is not defined; known are 1, 2, 3, 9"):
        read_text(tmp_path, "SPC=1\nSUBCASE 2\nSPC=7\nBEGIN BULK\n" + spc + BULK, "a.bdf")


def test_rotations_that_solids_have_not_are_not_held(tmp_path):
    """456 at nodes of solids, as preprocessors write, would be a support without motion and a surface of all faces."""
    text = "GRDSET,,,,,,,456\n" + BULK.replace("GRID,1,,0.,0.,0.", "GRID,1,,0.,0.,0.,,123")
    model = read_text(tmp_path, text, "a.bdf")
    assert held(model) == {"spc_grid_123": ["x", "y", "z"]}
    assert model.node_sets == {"spc_grid_123": [1]} and model.surfaces == {}
    assert model.notes == ["the held rotations of 7 nodes that have none, as nodes of solids"]
    shell = "GRID,9,,2.,0.,0.\nGRID,10,,2.,1.,0.\nCQUAD4,2,20,2,9,10,3\nPSHELL,20,7,0.1,7\n"
    model = read_text(tmp_path, text + shell, "a.bdf")
    assert held(model)["spc_grid_456"] == ["rx", "ry", "rz"]
    assert model.node_sets["spc_grid_456"] == [2, 3, 9, 10]


def test_sets_of_the_case_control(tmp_path):
    case = ("SET 1 = 1 THRU 8 EXCEPT 3, 5, 6, 7, 8\nset 2 = 2,3,\n 6,7\nSET 3 = 0.5, 1.5\nSET 4 = ALL\n"
            "SET 5 = 1, 2001\nSET 6 = 2001\nSET 7 = 1 THRU 3 EXCEPT 2, 5 THRU 6\nSET 8 = 1 THRU 7 BY 3\n")
    model = read_text(tmp_path, case + "BEGIN BULK\n" + BULK, "a.bdf")
    assert model.node_sets == {"set_1": [1, 2, 4], "set_5": [1], "set_7": [1, 3, 5, 6], "set_8": [1, 4, 7]}
    assert [frozenset(face) for face in model.surfaces["set_2"]] == [RIGHT]
    assert model.notes == [*(f"SET {n} of the case control, which is no list of numbers" for n in (3, 4)),
                           *(f"1 of the {n} numbers of set_{i}, which are no nodes" for i, n in ((5, 2), (6, 1)))]


def test_what_bulk_data_has_and_the_mesh_has_not_is_named(tmp_path):
    """Of parameters WTMASS and G are read, and loss factors of materials; a plate on a lining stays a surface."""
    text = BULK + ("PARAM,WTMASS,1.-3\nPARAM,G,0.02\nPARAM,POST,-1\nPARAM,W5,6000.\nMAT1,7,2.1+11,,.3,7850.,,,0.01\n"
                   "SPC,1,1,3,0.5\nGRID,9,,2.,0.,0.\nGRID,10,,2.,1.,0.\nCQUAD4,2,20,2,9,10,3,,0.1\n,,0,1.,1.\n"
                   "PSHELL,20,7,0.1,8,2.0,8,0.833333,0.4\n"
                   "CQUAD4,3,30,5,6,7,8\nPSHELL,30,7,5.\nCGAP,4,1,1,3\nCGAP,5,2,2,3\n")
    model = read_text(tmp_path, text, "a.bdf")
    assert model.materials["7"]["density"] == pytest.approx(7.85, rel=1e-15)
    scene = convert(tmp_path / "a.bdf", tmp_path / "out").read_text()
    assert scene.count("\nloss_factor = 0.03\n") == 2
    notes = "\n".join(model.notes)
    for words in ("the cards CGAP (2)", "T1 to T4 of 1 CQUAD4", "PARAM W5",
                  "thickness 5 of PSHELL 30, whose elements lie on solids", "MID2, 12I/T**3, NSM of PSHELL 20"):
        assert words in notes, words
    assert len(model.notes) == 5 and "\noffset = 0.1\n" in scene and 'fixed = "z"\ndisplacement = [0, 0, 0.5]' in scene


def test_parts_of_one_name_are_two(tmp_path):
    names = '$HMNAME PROP 10 "steel"\n$HMNAME PROP 11 "steel"\n'
    more = "".join(f"GRID,{i + 10},,{x}.,{y}.,{z + 5}.\n" for i, (x, y, z) in enumerate(CUBE, 1))
    model = read_text(tmp_path, names + BULK + more + "CHEXA,2,11,11,12,13,14,15,16\n,17,18\nPSOLID,11,7\n", "a.bdf")
    assert {name: part.elements for name, part in model.parts.items()} == {"steel": [1], "steel_11": [2]}


FLAT_CUBE = "*NODE\n" + "".join(f"{i}, {x}, {y}, {z}\n" for i, (x, y, z) in enumerate(CUBE, 1))
CUBE_ON_CUBE = FLAT_CUBE + (
    "9, 0,0,2\n10, 1,0,2\n11, 1,1,2\n12, 0,1,2\n*ELEMENT, TYPE=C3D8, ELSET=all\n1, 1,2,3,4,5,6,7,8\n"
    "2, 5,6,7,8,9,10,11,12\n")


def held(model):
    """Motions of supports by their groups, without axes and displacements."""
    assert not any(keys for *_, keys in model.supports)
    return {name: motions for name, motions, _ in model.supports}


def read_text(tmp_path, text, name="deck.inp"):
    (tmp_path / name).write_text(text)
    return TOOL.read_deck(tmp_path / name)


def groups_of(file):
    """{name: [(dimension, nodes)]} of the groups in a mesh, as gmsh lists them."""
    sections = dict(part.split("\n", 1) for part in file.read_text().split("$") if "\n" in part.strip())
    names = {int(line.split()[1]): line.split('"')[1] for line in sections["PhysicalNames"].splitlines()[1:]}
    counts, *entities = [line.split() for line in sections["Entities"].splitlines()]
    of = {}
    for dimension, count in enumerate(map(int, counts)):
        for entity in (entities.pop(0) for _ in range(count)):
            first = 4 if dimension == 0 else 7
            of[dimension, entity[0]] = [names[int(tag)] for tag in entity[first + 1 : first + 1 + int(entity[first])]]
    groups, lines = {}, [line.split() for line in sections["Elements"].splitlines()[1:]]
    while lines:
        dimension, entity, _, count = lines.pop(0)
        for cell in (lines.pop(0) for _ in range(int(count))):
            for name in of[int(dimension), entity]:
                groups.setdefault(name, {}).setdefault(int(dimension), set()).update(map(int, cell[1:]))
    return groups


def test_a_name_is_one_group(tmp_path, squeal):
    """Abaqus/CAE writes a set of nodes and one of elements by one name; a support of one must not hold the other."""
    text = CUBE_ON_CUBE + "*NSET, NSET=Set-1\n1,2,3,4\n*ELSET, ELSET=Set-1\n1\n*BOUNDARY\nSet-1, ENCASTRE\n"
    (tmp_path / "deck.inp").write_text(text)
    scene = convert(tmp_path / "deck.inp", tmp_path / "out")
    groups = groups_of(tmp_path / "out" / "deck.msh")
    assert groups["Set-1"] == {2: {1, 2, 3, 4}} and groups["Set-1_elements"] == {3: set(range(1, 9))}
    assert all(len(of) == 1 for of in groups.values())
    assert tomllib.loads(scene.read_text())["support"] == [{"on": "Set-1", "fixed": "all"}]
    assert "Set-1 of a set of elements" in scene.read_text()
    # a part keeps its name; supports and ties follow what is renamed
    text = CUBE_ON_CUBE.replace("ELSET=all", "ELSET=one") + (
        "*NSET, NSET=one\n1,2,3,4,5\n*SURFACE, NAME=one\none, S1\n*SURFACE, NAME=two\none, S2\n*TIE, NAME=t\nONE, Two\n"
        "*BOUNDARY\none, 1, 3\n*SOLID SECTION, ELSET=one, MATERIAL=m\n")
    model = read_text(tmp_path, text)
    assert list(model.parts) == ["one"] and model.ties == [("one_faces", "two")]
    assert held(model) == {"one_nodes": ["x", "y", "z"]} and model.node_sets["one_nodes"] == [1, 2, 3, 4, 5]
    # the same nodes under the same name are one group
    more = "*NSET, NSET=all, ELSET=all\n*NSET, NSET=low\n1,2,3,4\n*SURFACE, NAME=low\n1, S1\n"
    model = read_text(tmp_path, CUBE_ON_CUBE + more)
    assert list(model.parts) == ["all"] and list(model.surfaces) == ["low"]
    assert model.node_sets == {} and model.notes == []


PART = "*PART, NAME=p\n" + CUBE_ON_CUBE + "*SOLID SECTION, ELSET=all, MATERIAL=m\n*END PART\n*ASSEMBLY, NAME=a\n"


def test_numbers_outside_of_instances_are_others(tmp_path):
    """A reference point of the assembly has number 1, as has a node of the part; no node of the part moves."""
    text = PART + ("*INSTANCE, NAME=i, PART=p\n5.\n*END INSTANCE\n*NODE\n1, 9., 9., 9.\n*NSET, NSET=rp\n1\n"
                   "*NSET, NSET=low, INSTANCE=i\n1,2,3,4\n*END ASSEMBLY\n*BOUNDARY\nrp, 1, 6\nlow, PINNED\n")
    model = read_text(tmp_path, text)
    assert [tuple(model.nodes[n]) for n in (1, 7)] == [(5, 0, 0), (6, 1, 1)] and tuple(model.nodes[13]) == (9, 9, 9)
    assert held(model) == {"low": ["x", "y", "z"]} and "the set rp and its support" in model.notes[0]


@pytest.mark.parametrize("data, at", [("", (0, 0, 0)), ("5.\n", (5, 0, 0)), (",,3.\n", (0, 0, 3)),
                                      (",\n0,0,0,0,0,1,90\n", (0, 0, 0))])
def test_missing_numbers_of_a_translation_are_zero(tmp_path, data, at):
    text = PART + f"*INSTANCE, NAME=i, PART=p\n{data}*END INSTANCE\n*END ASSEMBLY\n"
    assert tuple(read_text(tmp_path, text).nodes[1]) == at


def test_a_part_without_instance_is_named(tmp_path):
    text = "*PART, NAME=spare\n*END PART\n" + PART + "*INSTANCE, NAME=i, PART=p\n*END INSTANCE\n*END ASSEMBLY\n"
    assert read_text(tmp_path, text).notes == ["*PART (line 1)"]


def test_data_from_other_files(tmp_path):
    """INPUT of a keyword, and an included file that goes on with its data."""
    (tmp_path / "nodes.txt").write_text("1, 0,0,0\n2, 1,0,0\n")
    (tmp_path / "more.txt").write_text("3, 0,1,0\n4, 0,0,1\n")
    model = read_text(tmp_path, "*NODE, INPUT=nodes.txt\n*INCLUDE, INPUT=more.txt\n"
                      "*ELEMENT, TYPE=C3D4, ELSET=e\n1, 1,2,3,4\n")
    assert list(model.nodes) == [1, 2, 3, 4] and model.notes == []


def test_what_an_input_deck_has_and_the_mesh_has_not_is_named(tmp_path):
    """Keywords, options, layers, lines and names; the skeleton has what it can of them."""
    shells = "*ELEMENT, TYPE=S4, ELSET=skin\n3, 9,10,11,12\n*ELEMENT, TYPE=S4, ELSET=bare\n4, 1,2,3,4\n"
    shells += "*ELEMENT, TYPE=B31, ELSET=rod\n5, 1,2\n6, 2,3\n"
    model = read_text(tmp_path, CUBE_ON_CUBE + shells + (
        "*ELSET, ELSET=mixed\nall, rod, 77\n*NSET, NSET=n\n1, 77\n*SURFACE, NAME=side\nall, S3\n*SURFACE, NAME=Top\n2, S2\n"
        "*SURFACE, NAME=r, TYPE=CYLINDER\nSTART, 0,1\n*MATERIAL, NAME=m\n*ELASTIC\n2e11, .3\n1e11, .3, 40.\n"
        "*DAMPING, BETA=1e-7, STRUCTURAL=0.01\n*SOLID SECTION, ELSET=all, MATERIAL=m\n"
        "*SHELL SECTION, ELSET=skin, COMPOSITE, OFFSET=SPOS\n0.1, 3, m\n0.2, 3, m\n*TIE, NAME=t\nSIDE, TOP\n"
        "*CONTACT PAIR\nr, TOP\nside, TOP\n"
        "*TIE, NAME=u\nrow, TOP\n*SURFACE, NAME=row, TYPE=NODE\n1\n2\n*SECTION PRINT, NAME=n\nSOF\n"
        "*BOUNDARY, OP=NEW\nskins, 4, 6\nn, ENCASTRE\nn, 11, 11, 20.\n*NSET, NSET=Skins\n5,6,7\n"
        "*STEP\n*STATIC\n*TEMPERATURE\n1,1.\n*TEMPERATURE\n2,1.\n*DSLOAD\nside, TRVEC, 1.\n*NODE FILE\nU\n*END STEP\n"))
    notes = "\n".join(model.notes)
    for words in ("2 elements of type B31",
                  "*SECTION PRINT (line 53)", "OP=NEW of *BOUNDARY (line 55)",
                  "*TEMPERATURE (2 times, first in line 63)", "*DSLOAD of type TRVEC on side (line 68)", "first line of *ELASTIC (line 35)",
                  "2 layers of *SHELL SECTION", "tie of row (slave) and Top (master): row has no faces",
                  "the surface r (line 32)", "degrees of freedom from 11 on of n",
                  "support of Skins along rx ry rz: its nodes have no rotations",
                  "1 shell without a *SHELL SECTION",
                  "1 node of the set n", "1 element of the set mixed that are not there, 77 the first", "the set rod, whose elements"):
        assert words in notes, words
    assert len(model.notes) == 15 and model.contacts[0][0].startswith("FILL IN [a surface]: r of the deck has no faces")
    assert model.ties == [("side", "Top")] and model.contacts[1] == ("side", "Top", {"friction": 0}) and held(model) == {"n": list(MOTIONS)}
    assert model.parts["skin"].thickness == pytest.approx(0.3, rel=1e-15) and model.parts["skin"].material == "M"
    assert model.parts["skin"].offset == pytest.approx(-0.15, rel=1e-15)
    scene = convert(tmp_path / "deck.inp", tmp_path / "out").read_text()
    assert "loss_factor = 0.01\nbeta = 1e-07\n" in scene and "loss_frequency = 10000" in scene


BAD = {
    "no such node": ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D4\n9,1,2,3,4\n", ["two.inp, line 4", "node 2"]),
    "an element too short": ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D4\n9,1,1,1\n", ["line 4", "3 nodes of C3D4", "expected 4"]),
    "a kind without a kernel": ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D18\n", ["line 3", "C3D18", "10, 15, 20 or 27"]),
    "a set that is missing": ("*NODE\n1,0,0,0\n*NSET, NSET=a\nb\n", ["line 4", "'b'"]),
    "a word for a number": ("*NODE\n1,0,zero,0\n", ["line 2", "'zero'", "a number"]),
    "a part that is missing": ("*PART, NAME=a\n*NODE\n1,0,0,0\n*END PART\n*INSTANCE, NAME=b, PART=c\n", ["line 5", "'c'", "known are A"]),
    "an instance that is missing": ("*PART, NAME=a\n*NODE\n1,0,0,0\n*END PART\n*INSTANCE, NAME=b, PART=a\n*END INSTANCE\n"
                                    "*NSET, NSET=n, INSTANCE=d\n1\n", ["line 7", "'d'", "known are b"]),
    "no instance": ("*PART, NAME=a\n*NODE\n1,0,0,0\n*END PART\n", ["*INSTANCE"]),
    "a node at two places": ("*NODE\n1,0,0,0\n2,0,0,0\n1,0,0,0\n1,0,0,2\n",
                             ["line 5", "node 1", "line 2", "one position"]),
    "a node below 1": ("*NODE\n0,0,0,0\n", ["line 2", "node 0", "from 1"]),
    "no number": ("*NODE\n1,0,nan,0\n", ["line 2", "'nan'"]),
    "an element twice": ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=S3\n1,1,1,1\n1,1,1,1\n", ["line 5", "line 4", "twice"]),
    "a system of a line": ("*SYSTEM\n1,0,0,2,0,0\n3,0,0\n*NODE\n1,0,0,0\n", ["line 3", "*SYSTEM", "on a line"]),
    "nodes made of none": ("*NODE\n1,0,0,0\n*NGEN\n1,5\n", ["line 4", "node 5", "not defined"]),
    "nodes mapped": ("*NODE\n1,0,0,0\n*NMAP\n1,5\n", ["line 3", "*NMAP", "preprocessor"]),
    "elements made of none": ("*NODE\n1,0,0,0\n*ELGEN, ELSET=e\n1,5\n", ["line 4", "element 1", "not defined"]),
    "an end within a keyword": ("*NODE\n1,0,0,0\n*NSET,\n", ["*NSET", "comma"]),
    "a surface of nothing": ("*NODE\n1,0,0,0\n*SURFACE, NAME=s\n,\n", ["line 4", "0 fields", "a face"]),
    "a support of nothing": ("*NODE\n1,0,0,0\n*BOUNDARY\n,\n", ["line 4", "0 fields", "ENCASTRE"]),
    "a density of nothing": ("*NODE\n1,0,0,0\n*MATERIAL, NAME=m\n*DENSITY\n,\n", ["line 5", "0 fields", "a density"]),
    "a step of 0": ("*NODE\n1,0,0,0\n*NSET, NSET=n, GENERATE\n1,5,0\n", ["line 4", "steps of 0"]),
    "a translation too long": ("*PART, NAME=a\n*END PART\n*INSTANCE, NAME=b, PART=a\n0,0,1,0\n",
                               ["line 4", "4 fields", "next line"]),
    "an axis of one point": ("*PART, NAME=a\n*END PART\n*INSTANCE, NAME=b, PART=a\n,\n0,0,1,0,0,1,9\n",
                             ["line 5", "axis"]),
    "an instance twice": ("*PART, NAME=a\n*END PART\n*INSTANCE, NAME=b, PART=a\n*END INSTANCE\n"
                          "*INSTANCE, NAME=B, PART=a\n",
                          ["line 5", "'B'", "line 3"]),
    "a support in two systems": (FLAT_CUBE + "*NSET, NSET=n\n1\n*NSET, NSET=m\n1,2\n*TRANSFORM, NSET=n\n0,1,0,-1,0,0\n"
                                 "*BOUNDARY\nm, 1\n",
                                 ["line 17", "x of m", "line 14", "set of its own"]),
    "a file that is not there": ("*HEADING\nx\n*INCLUDE, INPUT=gone.inc\n", ["two.inp, line 3", "includes gone.inc"]),
    "nothing": ("*HEADING\nx\n", ["two.inp", "*NODE"]),
    "a face that is not there": ("*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT, TYPE=C3D4, ELSET=e\n9,1,2,3,4\n*SURFACE, NAME=s\ne, S5\n",
                                 ["line 9", "'S5'", "S1 to S4"]),
}
BAD_BULK = {
    "mid-side nodes missing": ("GRID,1\nCTETRA,1,1,1,1,1,1,1,\n,1\n", ["two.bdf, line 2", "mid-side"]),
    "a coordinate system that is missing": ("GRID,1,7,0.,0.,0.\n", ["line 1", "system 7", "CORD2R"]),
    "a file that is not there": ("GRID,1\nINCLUDE 'gone.bdf'\n", ["two.bdf, line 2", "gone.bdf"]),
    "points on a line": ("CORD2R,7,,0.,0.,0.,0.,0.,1.\n,0.,0.,2.\nGRID,1,7,0.,0.,0.\n", ["line 1", "on a line"]),
    "a system in itself": ("CORD2R,7,7,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nGRID,1,7,0.,0.,0.\n", ["line 1", "in itself"]),
    "an element without a kernel": ("GRID,1\nCPYRAM,7,1,1,1,1,1,1,1\n,1\n", ["line 2", "CPYRAM 7", "7 nodes", "5 or 13"]),
    "a word for a number": ("GRID,1,,x,0.,0.\n", ["line 1", "GRID, field 4", "'x'"]),
    "a node at two places": ("GRID,1\nGRID,1,,1.,0.,0.\n", ["line 2", "node 1", "line 1", "one position"]),
    "a material twice": ("GRID,1\nMAT1,1,1.,,.3\nMAT1,1,2.,,.3\n", ["line 3", "MAT1 1", "line 2", "keep one"]),
    "a list that ends in THRU": ("GRID,1\nSPC1,1,3,1,THRU,x\n", ["line 2", "1 THRU X", "first THRU last"]),
    "a list that goes down": ("GRID,1\nSPC1,1,3,9,THRU,1\n", ["line 2", "9 THRU 1", "ascending"]),
    "a system that is a word": ("GRID,1,,0.,0.,0.,x\n", ["line 1", "'x'", "a whole number"]),
    "an element twice": ("GRID,1\nCTRIA3,1,1,1,1,1\nCTRIA3,1,1,1,1,1\n", ["line 3", "element 1", "twice"]),
}


@pytest.mark.parametrize("case", [*BAD, *(f"bulk: {name}" for name in BAD_BULK)])
def test_bad_decks_are_refused(tmp_path, case):
    text, words = BAD_BULK[case[6:]] if case.startswith("bulk") else BAD[case]
    deck = tmp_path / ("two.bdf" if case.startswith("bulk") else "two.inp")
    deck.write_text(text)
    with pytest.raises(TOOL.Problem) as refused:
        TOOL.read_deck(deck)
    for word in words:
        assert word in str(refused.value), refused.value


def test_what_meshio_cannot_read_is_one_sentence(tmp_path):
    pytest.importorskip("meshio")
    (tmp_path / "two.vtu").write_text("no mesh")
    with pytest.raises(TOOL.Problem, match="two.vtu: meshio cannot read it"):
        TOOL.read_deck(tmp_path / "two.vtu")
