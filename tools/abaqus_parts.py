"""Decks of Abaqus with parts and assemblies, made flat: every instance gets numbers of its own and its place."""

import numpy as np
from deck_files import Block, Problem, number, whole

NUMBERED = {"NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "BOUNDARY"}  # whose data lines hold numbers of nodes or elements
NAMING = {"NSET": "NSET", "ELSET": "ELSET", "SURFACE": "NAME"}  # options that name what a block defines
SETS = ("NSET", "ELSET")  # options that define a set in *NODE and *ELEMENT, and that other keywords refer to


class Instance:
    """One instance of a part: its blocks, what is added to their numbers, and how their positions move."""

    def __init__(self, block):
        self.name, self.part, self.place = block.options.get("NAME", ""), block.options.get("PART", ""), block.place
        self.blocks, self.offset, self.flat_names = [], 0, {}
        rows = list(block.rows())
        self.shift = np.array([number(field, place) for place, fields in rows[:1] for field in fields[:3]] or [0.0, 0.0, 0.0])
        self.turn = None
        if len(rows) > 1:
            place, fields = rows[1]
            if len(fields) != 7:
                raise Problem(f"{place}: {len(fields)} fields; expected two points of an axis and an angle in degrees")
            self.turn = [number(field, place) for field in fields]

    def moved(self, position):
        """Shifted, then turned about the line from the first point to the second."""
        position = np.asarray(position) + self.shift
        if self.turn is None:
            return position
        start, end, angle = np.array(self.turn[:3]), np.array(self.turn[3:6]), np.radians(self.turn[6])
        axis = (end - start) / np.linalg.norm(end - start)
        arm = position - start
        return start + np.cos(angle) * arm + np.sin(angle) * np.cross(axis, arm) + (1 - np.cos(angle)) * axis * (axis @ arm)


def flattened(blocks):
    """The blocks of a flat deck. A set of a part keeps its name where no other has it, else it is instance_set."""
    if not any(block.name in ("PART", "INSTANCE") for block in blocks):
        return blocks
    instances, outside = divided(blocks)
    number_instances(instances)
    name_sets(instances, outside)
    flat = [relabelled(block, instance, instances) for instance in instances for block in instance.blocks]
    return flat + [relabelled(block, None, instances) for block in outside]


def divided(blocks):
    """Instances with the blocks of their parts, and the blocks outside of parts and instances."""
    parts, instances, outside, scope = {}, [], [], None
    for block in blocks:
        if block.name == "PART":
            scope = parts.setdefault(block.options.get("NAME", "").upper(), [])
        elif block.name == "INSTANCE":
            instance = Instance(block)
            if instance.part.upper() not in parts:
                raise Problem(f"{block.place}: *INSTANCE of part '{instance.part}', which is not defined above; known are "
                              + (", ".join(parts) or "none"))
            instance.blocks = list(parts[instance.part.upper()])
            instances.append(instance)
            scope = instance.blocks
        elif block.name in ("END PART", "END INSTANCE"):
            scope = None
        elif block.name not in ("ASSEMBLY", "END ASSEMBLY"):
            (outside if scope is None else scope).append(block)
    if not instances:
        raise Problem(f"{blocks[0].place}: parts without an *INSTANCE; expected an *ASSEMBLY that places them")
    return instances, outside


def number_instances(instances):
    """Offsets so that no two instances share a number; the first keeps its own."""
    offset = 0
    for instance in instances:
        instance.offset = offset
        numbers = [whole(fields[0], place) for block in instance.blocks if block.name in ("NODE", "ELEMENT")
                   for place, fields in block.rows() if fields and fields[0].isdigit()]
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
    for scope in [*(instance.blocks for instance in instances), outside]:
        for name in {name.upper() for block in scope for name in names_in(block)}:
            count[name] = count.get(name, 0) + 1
    for instance in instances:
        for block in instance.blocks:
            for name in names_in(block):
                alone = count[name.upper()] == 1
                instance.flat_names[name.upper()] = name if alone else f"{instance.name}_{name}"


def relabelled(block, instance, instances):
    """A copy of a block of an instance, or of none, with the numbers and names of the flat deck."""
    if instance is None and "INSTANCE" in block.options:
        instance = find_instance(block.options["INSTANCE"], block.place, instances)
        defines = True
    else:
        defines = instance is None
    copy = Block(block.place, block.name, dict(block.options))
    for key in ("NSET", "ELSET", "NAME"):
        own = key == NAMING.get(block.name)
        if key in copy.options and (key != "NAME" or own) and not (defines and own):
            copy.options[key] = flat_text(copy.options[key], block.place, instance, instances)
    copy.lines = [(place, flat_line(block, place, line, instance, instances)) for place, line in block.lines]
    return copy


def find_instance(name, place, instances):
    for instance in instances:
        if instance.name.upper() == name.upper():
            return instance
    raise Problem(f"{place}: the instance '{name}' is not defined; known are {', '.join(i.name for i in instances)}")


def flat_text(text, place, instance, instances):
    """A number or the name of a set as the flat deck has it; text may be instance.name."""
    owner, dot, name = text.partition(".")
    if dot and any(owner.upper() == known.name.upper() for known in instances):
        instance, text = find_instance(owner, place, instances), name
    if instance is None:
        return text
    if text.isdigit():
        return str(int(text) + instance.offset)
    return instance.flat_names.get(text.upper(), text)


def flat_line(block, place, line, instance, instances):
    fields = [field.strip() for field in line.split(",")]
    if block.name == "NODE" and instance is not None and len(fields) >= 2:
        position = [number(field or "0", place) for field in (fields[1:4] + ["0", "0"])[:3]]
        fields[1:4] = [repr(float(value)) for value in instance.moved(position)]
    last = len(fields)
    if block.name in ("NODE", "SURFACE", "BOUNDARY"):
        last = 1
    elif "GENERATE" in block.options:
        last = 2
    elif block.name not in NUMBERED and block.name not in ("TIE", "CONTACT PAIR"):
        return line
    changed = [flat_text(field, place, instance, instances) if field else field for field in fields[:last]]
    return ", ".join(changed + fields[last:])
