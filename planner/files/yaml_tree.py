"""YAML 1.2 as plain Python values, with the line of every key and entry, and all faults of it."""

from typing import NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from planner.faults import NOTHING, Fault, Loc

MAX_NODES = 200_000  # far more than any site; aliases of aliases would otherwise grow without end
PLAIN_TAGS = frozenset(
    f"tag:yaml.org,2002:{kind}" for kind in ("str", "int", "float", "bool", "null", "timestamp")
)


class YamlFault(NamedTuple):
    """A fault with the line that it stands on (None: not known)."""

    line: int | None
    fault: Fault


class Tree:
    """A YAML document: its value, the line of each place in it, and what is wrong with it as YAML."""

    def __init__(self, text: str) -> None:
        self.value: object = None
        self.lines: dict[Loc, int] = {(): 1}
        self.faults: list[YamlFault] = []
        self._constructor: SafeConstructor
        self._open: set[int] = set()
        self._count = 0
        try:
            yaml = YAML(typ="safe", pure=True)
            node = yaml.compose(text)
            self._constructor = yaml.constructor
        except MarkedYAMLError as error:
            self._refuse_syntax(error)
            return
        except YAMLError as error:  # control characters: the reader knows no line
            self.faults.append(YamlFault(None, Fault((), _one_line(error), "YAML 1.2 text")))
            return
        if node is not None:
            self.lines[()] = node.start_mark.line + 1
            self.value = self._build(node, ())

    def line(self, loc: Loc) -> int:
        """The line of a place; of the nearest place around it where it is not in the file."""
        while loc not in self.lines:
            loc = loc[:-1]
        return self.lines[loc]

    def _refuse_syntax(self, error: MarkedYAMLError) -> None:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else None
        column = f" (column {mark.column + 1})" if mark else ""
        came = f"{error.problem or error.context}{column}"
        context = f" {error.context}" if error.problem and error.context else ""
        hint = "Look at this line and the one above: indentation, colons, brackets, quotes."
        self.faults.append(YamlFault(line, Fault((), _Said(came + context), "YAML 1.2", hint)))

    def _refuse(self, node: Node, loc: Loc, came: object, allowed: str, hint: str = "") -> None:
        self.faults.append(YamlFault(node.start_mark.line + 1, Fault(loc, came, allowed, hint)))

    def _build(self, node: Node, loc: Loc) -> object:
        self._count += 1
        if id(node) in self._open or self._count > MAX_NODES:
            self._refuse(
                node, loc, _Said("an alias that holds itself, or far too many values"), "a finite document"
            )
            return None
        self._open.add(id(node))
        try:
            if isinstance(node, MappingNode):
                return self._mapping(node, loc)
            if isinstance(node, SequenceNode):
                return self._sequence(node, loc)
            return self._scalar(node, loc)
        finally:
            self._open.discard(id(node))

    def _mapping(self, node: MappingNode, loc: Loc) -> dict[str, object]:
        values: dict[str, object] = {}
        for key_node, value_node in node.value:
            line = key_node.start_mark.line + 1
            if not isinstance(key_node, ScalarNode):
                self._refuse(key_node, loc, _Said("a list or mapping as a key"), "a word as a key")
                continue
            key = str(key_node.value)
            if key in values:
                first = self.lines[(*loc, key)]
                text = f"this key is given twice, first on line {first}; allowed: each key once."
                self.faults.append(YamlFault(line, Fault((*loc, key), NOTHING, "", text)))
                continue
            self.lines[(*loc, key)] = line
            values[key] = self._build(value_node, (*loc, key))
        return values

    def _sequence(self, node: SequenceNode, loc: Loc) -> list[object]:
        for index, item in enumerate(node.value):
            self.lines[(*loc, index)] = item.start_mark.line + 1
        return [self._build(item, (*loc, index)) for index, item in enumerate(node.value)]

    def _scalar(self, node: Node, loc: Loc) -> object:
        if node.tag not in PLAIN_TAGS:
            self._refuse(
                node, loc, _Said(f"the tag {node.tag}"), "plain values: text, numbers, true, false, null"
            )
            return None
        try:
            return self._constructor.construct_object(node)
        except (MarkedYAMLError, ValueError, OverflowError) as error:
            self._refuse(
                node, loc, _Said(f"{node.value}, which cannot be read ({_one_line(error)})"), "a plain value"
            )
            return None


class _Said(str):
    """Words of ours rather than a value of the user's: shown without quotes."""

    def __repr__(self) -> str:
        return str(self)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
