"""Decks of Abaqus with parts and assemblies, made flat: every instance gets numbers of its own and its place."""

import numpy as np
from squeal.abaqus_nodes import made_explicit
from squeal.deck_files import Problem, number, whole

NUMBERED = {"NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "BOUNDARY"}  # whose data lines hold numbers of nodes or elements
FIRST = {"NODE", "SURFACE", "BOUNDARY", "CLOAD", "DLOAD", "DSLOAD", "MOTION", "KINEMATIC COUPLING"}  # in the first field alone
PAIRS = {"TIE", "CONTACT PAIR", "MPC"}  # whose data lines hold names
REFERRING = ("NSET", "ELSET", "NAME", "REF NODE", "SURFACE", "NODE", "TIE NSET", "PIN NSET", "ELEMENT")  # options with names
NAMING = {"NSET": "NSET", "ELSET": "ELSET", "SURFACE": "NAME"}  # options that name what a block defines
SETS = ("NSET", "ELSET")  # options that define a set in *NODE and *ELEMENT, and that other keywords refer to


class Scope:
    """One instance of a part, or what stands outside of all: its blocks, what is added to their numbers, and the names
    that its sets get."""

    def __init__(self, name="", part="", place=""):
        self.name, self.part, self.place = name, part, place
        self.blocks, self.offset, self.flat_names = [], 0, {}
        self.shift, self.turn = np.zeros(3), None

    def moved(self, position):
        """Shifted, then turned about the line from the first point to the second."""
        position = np.asarray(position) + self.shift
        if self.turn is None:
            return position
        start, end, angle = np.array(self.turn[:3]), np.array(self.turn[3:6]), np.radians(self.turn[6])
        axis = (end - start) / np.linalg.norm(end - start)
        arm = position - start
        return start + np.cos(angle) * arm + np.sin(angle) * np.cross(axis, arm) + (1 - np.cos(angle)) * np.multiply.outer(arm @ axis, axis)


def instance_of(block):
    instance = Scope(block.options.get("NAME", ""), block.options.get("PART", ""), block.place)
    rows = list(block.rows())
    if len(rows) > 2:
        raise Problem(f"{rows[2][0]}: a third line of *INSTANCE; expected a translation and a rotation")
    if rows:
        place, fields = rows[0]
        if len(fields) > 3:
            raise Problem(f"{place}: {len(fields)} fields; expected the translation x, y, z alone; a rotation "
                          "goes into the next line")
        instance.shift[: len(fields)] = [number(field or "0", place) for field in fields]
    if len(rows) > 1:
        place, fields = rows[1]
        if len(fields) != 7:
            raise Problem(f"{place}: {len(fields)} fields; expected two points of an axis and an angle in degrees")
        instance.turn = [number(field or "0", place) for field in fields]
        if instance.turn[:3] == instance.turn[3:6]:
            raise Problem(f"{place}: the two points of the axis are the same; expected two points")
    return instance


def flattened(blocks):
    """The blocks of a flat deck. A set of a part keeps its name where no other has it, else it is instance_set."""
    if not any(block.name in ("PART", "INSTANCE") for block in blocks):
        return blocks
    instances, outside = divided(blocks)
    for scope in (*instances, outside):
        scope.blocks = made_explicit(scope.blocks)
    number_scopes([*instances, outside])
    name_sets(instances, outside)
    return [relabelled(block, scope, instances) for scope in [*instances, outside] for block in scope.blocks]


def divided(blocks):
    """Instances with the blocks of their parts, and the blocks outside of both, among them *PART of parts that are
    placed nowhere."""
    parts, heads, instances, outside = {}, {}, [], Scope()
    scope = outside.blocks
    for block in blocks:
        if block.name == "PART":
            name = block.options.get("NAME", "").upper()
            scope = parts.setdefault(name, [])
            heads[name] = block
        elif block.name == "INSTANCE":
            instance = instance_of(block)
            if instance.part.upper() not in parts:
                raise Problem(f"{block.place}: *INSTANCE of part '{instance.part}', which is not defined above; known are "
                              + (", ".join(parts) or "none"))
            if before := [other for other in instances if other.name.upper() == instance.name.upper()]:
                raise Problem(f"{block.place}: the instance '{instance.name}' is there twice, first in "
                              f"{before[0].place}; give it another name")
            instance.blocks = list(parts[instance.part.upper()])
            instances.append(instance)
            scope = instance.blocks
        elif block.name in ("END PART", "END INSTANCE"):
            scope = outside.blocks
        elif block.name not in ("ASSEMBLY", "END ASSEMBLY"):
            scope.append(block)
    if not instances:
        raise Problem(f"{blocks[0].place}: parts without an *INSTANCE; expected an *ASSEMBLY that places them")
    placed = {instance.part.upper() for instance in instances}
    outside.blocks += [head for name, head in heads.items() if name not in placed]
    return instances, outside


def number_scopes(scopes):
    """Offsets so that no two scopes share a number; the first keeps its own."""
    offset = 0
    for scope in scopes:
        scope.offset = offset
        numbers = [whole(fields[0], place) for block in scope.blocks if block.name in ("NODE", "ELEMENT")
                   for place, fields in block.rows() if fields and fields[0].isdecimal()]
        offset += max(numbers, default=0)


def names_in(block):
    """What a block defines."""
    if block.name in NAMING:
        return [block.options[NAMING[block.name]]] if NAMING[block.name] in block.options else []
    if block.name in ("NODE", "ELEMENT"):
        return [block.options[key] for key in SETS if key in block.options]
    return []


def name_sets(instances, outside):
    count = {}
    for scope in [*instances, outside]:
        for name in {name.upper() for block in scope.blocks for name in names_in(block)}:
            count[name] = count.get(name, 0) + 1
    for instance in instances:
        for block in instance.blocks:
            for name in names_in(block):
                flat = name if count[name.upper()] == 1 else f"{instance.name}_{name}"
                while flat != name and flat.upper() in count:
                    flat += "_"
                instance.flat_names[name.upper()] = flat


def relabelled(block, scope, instances):
    """A copy of a block with the numbers and names of the flat deck; one outside of all keeps the name that it defines,
    also where it is of an instance."""
    defines = scope not in instances
    if defines and "INSTANCE" in block.options:
        scope = find_instance(block.options["INSTANCE"], block.place, instances)
    copy = block.with_lines([])
    for key in REFERRING:
        own = key == NAMING.get(block.name)
        if key in copy.options and (key != "NAME" or own) and not (defines and own):
            copy.options[key] = flat_text(copy.options[key], scope, instances)
    copy.texts = flat_texts(block, scope, instances)
    return copy


def find_instance(name, place, instances):
    for instance in instances:
        if instance.name.upper() == name.upper():
            return instance
    raise Problem(f"{place}: the instance '{name}' is not defined; known are {', '.join(i.name for i in instances)}")


def flat_text(text, scope, instances):
    """A number or the name of a set as the flat deck has it; text may be instance.name."""
    owner, dot, name = text.partition(".")
    if dot:
        scope, text = next(((known, name) for known in instances if owner.upper() == known.name.upper()), (scope, text))
    if text.isdecimal():
        return str(int(text) + scope.offset)
    return scope.flat_names.get(text.upper(), text)


def flat_texts(block, scope, instances):
    """The lines of a block; nodes of plain numbers at once."""
    table = block.table(4, float) if block.name == "NODE" else None
    if table is not None:
        numbers = (table[:, 0].astype(np.int64) + scope.offset).tolist()
        return [f"{n}, {x!r}, {y!r}, {z!r}" for n, (x, y, z) in zip(numbers, scope.moved(table[:, 1:]).tolist())]
    if block.name == "ELEMENT" and scope.offset == 0:
        return block.texts
    return [flat_line(block, i, line, scope, instances) for i, line in enumerate(block.texts)]


def flat_line(block, index, line, scope, instances):
    fields = [field.strip() for field in line.split(",")]
    if block.name == "NODE" and len(fields) >= 2:
        place = block.place_at(index)
        position = [number(field or "0", place) for field in (fields[1:4] + ["0", "0"])[:3]]
        fields[1:4] = [repr(float(value)) for value in scope.moved(position)]
    last, step = len(fields), 1
    if block.name in FIRST:
        last = 1
    elif block.name == "EQUATION":
        last, step = (len(fields), 3) if len(fields) > 2 and fields[2] else (0, 1)
    elif "GENERATE" in block.options:
        last = 2
    elif block.name not in NUMBERED and block.name not in PAIRS:
        return line
    for i in range(0, last, step):
        if fields[i]:
            fields[i] = flat_text(fields[i], scope, instances)
    return ", ".join(fields)
