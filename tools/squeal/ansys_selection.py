"""What Workbench writes beside the commands of CDWRITE: parameters and tables, attributes of elements, selections."""

import re

from squeal.deck_files import Problem, number, span, whole

LABEL_AT = {"*SET": 1, "MP": 1, "MPDATA": 1, "D": 2, "F": 2}  # words that are labels, also where a parameter has their name
ATTRIBUTES = ("MAT", "TYPE", "REAL", "SECNUM")


class State:
    """What later commands refer to."""

    def __init__(self):
        self.parameters, self.tables = {}, {}  # texts of numbers by name, of tables the value in their last row
        self.attributes = dict.fromkeys(ATTRIBUTES, 1)
        self.nodes, self.elements = None, None  # that are selected; None: all
        self.unread = ""  # the selection by other means than names and numbers
        self.last = 0  # number of an element
        self.body, self.body_names = "", {}  # of the next elements, and by material and section


def filled(words, deck):
    """The words with numbers in the place of parameters and tables."""
    state, label_at = deck.state, LABEL_AT.get(words[0].upper(), 0)
    for i, word in enumerate(words):
        if i and i != label_at and (found := state.parameters.get(word.upper())):
            words[i] = found
        elif len(word) > 2 and word[0] == word[-1] == "%":
            name = word[1:-1].upper()
            words[i] = state.tables.get(name, state.parameters.get(name, word))
    return words


def assignment(line, deck):
    """Whether a line is NAME=value or TABLE(row,1,1)=value, which are remembered where the value is a number."""
    found = re.match(r"\s*([A-Za-z_]\w*)\s*(\([\d\s,]*\))?\s*=\s*(.*)$", line)
    if not found:
        return False
    name, index, value = found.groups()
    remember(name, index, value.strip(), deck)
    return True


def remember(name, index, value, deck):
    state = deck.state
    known = state.tables if index else state.parameters
    value = state.parameters.get(value.upper(), value)
    try:
        float(value)
    except ValueError:
        state.parameters.pop(name.upper(), None)
        return
    if not index or re.fullmatch(r"\(\s*\d+\s*,\s*1\s*(,\s*1\s*)?\)|\(\s*\d+\s*\)", index):  # column 0 has the times
        known[name.upper()] = value


def parameter(words, place, deck):
    """*SET,name,value."""
    if len(words) > 1:
        name, _, index = words[1].partition("(")
        remember(name, index and f"({index}", words[2] if len(words) > 2 else "", deck)


def attribute(words, place, deck):
    """TYPE, MAT, REAL and SECNUM of the elements that follow."""
    if len(words) > 1 and words[1]:
        deck.state.attributes[words[0].upper()] = whole(words[1], place)


def element(words, place, deck):
    """EN,number,nodes, or E,nodes: one element of the present attributes."""
    if words[0].upper() == "EN":
        if len(words) > 1 and words[1].upper().startswith("R"):  # EN,R5.5,ATTR,-1 is the end of a block
            return
        label, texts = whole(words[1] if len(words) > 1 else "", place), words[2:]
    else:
        label, texts = deck.state.last + 1, words[1:]
    nodes = [whole(word, place) for word in texts if word]
    if not nodes:
        raise Problem(f"{place}: an element without nodes; expected EN,number,nodes")
    material, kind, real, section = deck.state.attributes.values()
    deck.add_element(deck, place, label, [material, kind, real, section, 0], nodes)


def body_title(line, deck):
    """A comment of Workbench above the elements of a body."""
    if found := re.search(r'Elements for Body \d+ "([^"]*)"', line):
        deck.state.body = re.sub(r"[^\w()-]+", "_", found[1].rpartition("\\")[2]).strip("_")


def name_bodies(before, deck):
    """The last title is the name of the bodies that an EBLOCK made; before: how many elements they had."""
    for key, elements in deck.bodies.items():
        if len(elements) > before.get(key, 0):
            deck.state.body_names[key] = deck.state.body if key not in before else ""


# ---- selections


def select(words, place, deck):
    """NSEL, ESEL, CMSEL, NSLE and ALLSEL: by names of components, types and numbers; what others select is not known."""
    state, words = deck.state, [word.upper() for word in words] + [""] * 7
    command, how, what = words[:3]
    if command == "ALLSEL" or how in ("ALL", "") and command != "NSLE":
        state.unread = ""
        state.nodes, state.elements = (state.nodes if command == "ESEL" else None), (state.elements if command == "NSEL" else None)
    elif how not in ("S", "A") or how == "A" and state.unread:
        state.unread = "" if command == "NSLE" and state.elements is not None else ",".join(words[:7]).rstrip(",")
    elif command == "CMSEL" and chosen(what, deck.model.node_sets) is not None:
        take(state, "nodes", how, chosen(what, deck.model.node_sets))
    elif command == "CMSEL" and chosen(what, deck.model.element_sets) is not None:
        take(state, "elements", how, chosen(what, deck.model.element_sets))
    elif command == "ESEL" and what == "TYPE":
        take(state, "elements", how, [n for n, kind in deck.skin_types.items() if kind == whole(words[4], place)])
    elif command in ("NSEL", "ESEL") and what in ("NODE", "ELEM") and words[4]:
        last = whole(words[5] or words[4], place)
        take(state, "nodes" if command == "NSEL" else "elements", how, list(span(whole(words[4], place), last, whole(words[6] or "1", place), place)))
    else:
        state.unread = ",".join(words[:7]).rstrip(",")


def chosen(name, sets):
    return next((items for known, items in sets.items() if known.upper() == name), None)


def take(state, what, how, items):
    before = getattr(state, what) if how == "A" else None
    setattr(state, what, [*(before or []), *items])
    state.unread = ""


def selected_nodes(words, place, deck):
    """Those that a command acts on by ALL."""
    state = deck.state
    if state.unread:
        deck.note(f"{','.join(words).upper()} on the nodes of {state.unread}: name them in a component and select it by CMSEL", place)
        return []
    if state.nodes == []:
        deck.note(f"{','.join(words).upper()} while no node is selected", place)
    return list(deck.model.nodes) if state.nodes is None else state.nodes


def component(words, place, deck):
    """CM,name,NODE or ELEM: of what is selected."""
    words = words + [""] * 3
    state, kind = deck.state, words[2].upper()
    items = state.nodes if kind.startswith("NODE") else state.elements
    if state.unread or items is None:
        deck.note(f"the component {words[1]} of the nodes or elements that are selected", place)
    else:
        (deck.model.node_sets if kind.startswith("NODE") else deck.model.element_sets)[words[1]] = items


def surface_load(words, place, deck):
    """SF,nodes,PRES,value: on surface elements that are selected, or else on the faces whose nodes are."""
    words = words + [""] * 4
    if words[2].upper() != "PRES":
        deck.left_out[f"SF of {words[2]}"] += 1
        return
    value = number(words[3], place)
    skins = [n for n in deck.state.elements or () if n in deck.skins]
    if words[1].upper() == "ALL" and skins:
        deck.pressed += [(n, 1, value, place) for n in skins] if value else []
    elif nodes := deck.nodes_of(words[:2], place, deck):
        deck.pressed_nodes.append((set(nodes), value, place))


COMMANDS = {"*SET": parameter, "E": element, "EN": element, "CM": component, "SF": surface_load, **dict.fromkeys(ATTRIBUTES, attribute),
            **dict.fromkeys(("NSEL", "ESEL", "CMSEL", "NSLE", "ALLSEL", "ALLS"), select)}
