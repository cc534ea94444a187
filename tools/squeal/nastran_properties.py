"""Materials and properties of Nastran and OptiStruct: parts, and surfaces of flat elements on solids."""

import numpy as np
from squeal.deck_files import Problem
from squeal.mesh_model import FLAT, KINDS, Part, corners_of

# places of ZOFFS and of the thicknesses at the corners
SHELL_FIELDS = {"CQUAD4": (9, (12, 13, 14, 15)), "CTRIA3": (8, (12, 13, 14)), "CQUADR": (9, (12, 13, 14, 15)), "CTRIAR": (8, (12, 13, 14)),
                "CQUAD8": (17, (12, 13, 14, 15)), "CTRIA6": (11, (12, 13, 14))}
MIDDLE_BY_WORD = {"TOP": -0.5, "BOTTOM": 0.5, "BOT": 0.5}  # of the thickness, of OptiStruct


def note_shell_fields(cards, model):
    for name, (_, places) in SHELL_FIELDS.items():
        count = sum(any(card.number(i, 0.0) for i in places) for card in cards.elements[name])
        if count:
            model.notes.append(f"T1 to T{len(places)} of {count} {name}")


def offsets_of(cards, card, thickness, elements):
    """Elements of a property by the offset of their middle surface from the nodes: their own ZOFFS, or else that of the PSHELL."""
    def value(card, i):
        word = card.field(i).upper()
        return MIDDLE_BY_WORD[word] * thickness if word in MIDDLE_BY_WORD else card.number(i, 0.0)

    usual = value(card, 14) if card and card.name == "PSHELL" else 0.0
    own = {of.whole(2): value(of, place) for name, (place, _) in SHELL_FIELDS.items() for of in cards.elements[name] if of.field(place)}
    found = {}
    for n in elements:
        found.setdefault(own.get(n, usual), []).append(n)
    return found


def read_materials(cards, deck):
    """GE of a material and G of all are loss factors, W3 and W4 where they have their viscous equivalent; WTMASS multiplies densities."""
    model, values = deck.model, {}
    for card in cards:
        if card.name == "PARAM":
            values[card.field(2).upper()] = card
        elif card.name in ("MAT1", "MAT2", "MAT8", "MAT9", "MATORT"):
            model.material_places[card.field(2), None] = card.place
    model.loss_frequency = max(values[name].number(3, 0.0) if name in values else 0.0 for name in ("W3", "W4")) / (2 * np.pi)
    others = sorted(set(values) - {"WTMASS", "G", "POST", "W3", "W4"})
    if others:
        model.notes.append("PARAM " + ", ".join(others))
    mass = values["WTMASS"].number(3, 1.0) if "WTMASS" in values else 1.0
    model.loss_factor = values["G"].number(3, 0.0) if "G" in values else 0.0
    for card in by_number(cards, "MAT1").values():
        young, shear, poisson = (card.number(i, 0.0) for i in (3, 4, 5))
        if card.field(5) == "" and young and shear:
            poisson = young / (2 * shear) - 1
        young = young or 2 * shear * (1 + poisson)
        model.materials[card.field(2)] = {"young": young, "poisson": poisson, "density": card.number(6, 0.0) * mass,
                                          "loss_factor": card.number(9, 0.0)}
    for card in by_number(cards, "MAT9", "MATORT").values():
        constants, density = constants_of(card, deck)
        loss = card.number(32, 0.0) if card.name == "MAT9" else 0.0
        model.materials[card.field(2)] = constants | {"density": density * mass, "loss_factor": loss}
    for card in by_number(cards, "MAT2", "MAT8").values():
        loss = card.number(14 if card.name == "MAT2" else 18, 0.0)
        model.materials[card.field(2)] = flat_constants(card, deck) | {"density": card.number(9, 0.0) * mass, "loss_factor": loss}


def flat_constants(card, deck):
    """Of shells: MAT2 with G11 G12 G13 G22 G23 G33, MAT8 with E1 E2 NU12 G12. Young's modulus and Poisson's ratio where they are
    isotropic, as squeal's shells are; the constants of others stand for what the scene lacks."""
    if card.name == "MAT8":
        first, second, nu, shear = (card.number(i, 0.0) for i in (3, 4, 5, 6))
        across = [card.number(i, 0.0) or shear for i in (7, 8)]
        found = {"orthotropic": {"young": [first, second, second], "poisson": [nu, nu, nu], "shear": [shear, *across]}}
    else:
        g11, g12, g13, second, g23, shear = (card.number(i, 0.0) for i in range(3, 9))
        nu, found = g12 / (second or 1), {}
        first, second = g11 - nu * g12, second - nu * g12
        if abs(g13) + abs(g23) > 1e-6 * abs(g11):
            second = 0.0  # not isotropic
    if abs(first - second) <= 1e-6 * first and abs(shear - first / (2 * (1 + nu))) <= 1e-6 * first:
        return {"young": first, "poisson": nu}
    deck.note(f"{card.name} {card.field(2)}, which is not isotropic as squeal's shells are", card)
    return found


def constants_of(card, deck):
    """Nine constants, and the density: of MATORT, or of MAT9 whose stiffness is orthotropic."""
    if card.name == "MATORT":  # E1 E2 E3 NU12 NU23 NU31 RHO, G12 G23 G31
        young = [card.number(i) for i in (3, 4, 5)]
        nu12, nu23, nu31 = (card.number(i, 0.0) for i in (6, 7, 8))
        shear = [card.number(i) for i in (10, 12, 11)]
        return {"orthotropic": {"young": young, "poisson": [nu12, nu31 * young[0] / young[2], nu23], "shear": shear}}, card.number(9, 0.0)
    upper, stiffness, i = np.zeros((6, 6)), None, 3
    for row in range(6):
        for column in range(row, 6):
            upper[row, column], i = card.number(i, 0.0), i + 1
    stiffness = upper + np.triu(upper, 1).T
    mixed = np.abs(stiffness[:3, 3:]).max() + np.abs(np.triu(stiffness[3:, 3:], 1)).max()
    if mixed or np.linalg.matrix_rank(stiffness) < 6:
        deck.note(f"MAT9 {card.field(2)}, whose axes couple tension and shear", card)
        return {}, card.number(24, 0.0)
    compliance = np.linalg.inv(stiffness[:3, :3])
    young = 1 / np.diag(compliance)
    poisson = [float(-compliance[a, b] * young[a]) for a, b in ((0, 1), (0, 2), (1, 2))]
    constants = {"young": young.tolist(), "poisson": poisson, "shear": [stiffness[3, 3], stiffness[5, 5], stiffness[4, 4]]}
    return {"orthotropic": constants}, card.number(24, 0.0)


def by_number(cards, *names):
    found = {}
    for card in cards:
        if card.name in names:
            before = found.setdefault(card.whole(2), card)
            if before.fields != card.fields:
                raise Problem(f"{card.place}: {card.name} {card.field(2)} is there twice, first in {before.place}; "
                              "keep one")
    return found


def read_properties(cards, deck, of_property):
    """A part for every property; flat elements on the faces of solids are surfaces, whatever their property."""
    model, properties = deck.model, by_number(cards, "PSOLID", "PSHELL")
    free = model.free_faces(model.solids())
    for pid, elements in of_property.items():
        name = deck.names.get(("PROP", str(pid)), f"property_{pid}")
        if model.unused(name) != name:
            name += f"_{pid}"
        card = properties.get(pid)
        material = card.field(3) if card else None
        flat = [n for n in elements if model.elements[n][0] in FLAT]
        solid = [n for n in elements if model.elements[n][0] in KINDS]
        if solid:
            model.parts[name] = Part(solid, material)
            model.parts[name].axes = axes_of(card, deck)
        thickness = card.number(4, 0.0) if card and card.name == "PSHELL" else 0.0
        bare = [n for n in flat if corners_of(model.elements[n][1]) not in free]
        if flat and not bare:
            shown = model.unused(name if not solid else name + "_faces")
            model.surfaces[shown] = [model.elements[n][1] for n in flat]
            if thickness:
                model.notes.append(f"the thickness {thickness:g} of PSHELL {pid}, whose elements lie on solids: {shown} "
                                   "is a surface; a [[part]] with a thickness makes shells of it")
        elif flat:
            for offset, of in offsets_of(cards, card, thickness, flat).items():
                part = model.parts[model.unused(name if not solid else name + "_shells")] = Part(of, material, thickness, offset)
                part.place = card.place if card else ""
            note_shell_property(card, model)


def axes_of(card, deck):
    """Material axes of CORDM of a PSOLID."""
    system = card.field(4) if card and card.name == "PSOLID" else ""
    if system in ("", "0") or not system.isdecimal():
        if system == "-1":
            deck.note(f"CORDM -1 of PSOLID {card.field(2)}: its material has the basic axes", card)
        return None
    return deck.systems.keys(int(system), card.place)


def note_shell_property(card, model):
    """What a homogeneous shell of one material has not: other bending, shear or membrane, and a mass of its own."""
    if card is None or card.name != "PSHELL":
        return
    found = ["MID2"] if card.field(5) != card.field(3) else []
    found += ["MID4"] if card.field(12) else []
    for what, i, usual in (("12I/T**3", 6, 1.0), ("TS/T", 8, 5 / 6), ("NSM", 9, 0.0)):
        if abs(card.number(i, usual) - usual) > 1e-3:
            found.append(what)
    if found:
        model.notes.append(f"{', '.join(found)} of PSHELL {card.field(2)}")
