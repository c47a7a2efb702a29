"""Terms: what the code of an effect computes, written as Python that a person reads.

The effect's own code is run with terms in the place of numbers. A `Symbol` stands for what changes, such as a height; a
`Named` number, such as a parameter, keeps its value, so that code which needs a plain number still gets one. Local
variables of the effect's code become local variables of what is written.
"""

import math
import operator
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType
from typing import Any, TypeAlias

from pydantic import BaseModel

from quadctl import numeric
from quadctl.numeric import SYMBOLIC

_COMPARES, _ADDS, _MULTIPLIES, _NEGATES, _RAISES, _CALLS = range(6)
"""Binding strength of what is written."""
_STRENGTH = {
    **dict.fromkeys((">", ">=", "<", "<="), _COMPARES),
    **dict.fromkeys(("+", "-"), _ADDS),
    **dict.fromkeys(("*", "/"), _MULTIPLIES),
    "neg": _NEGATES,
    "**": _RAISES,
}
_NUMPY = {
    "exp": "np.exp",
    "sqrt": "np.sqrt",
    "sin": "np.sin",
    "cos": "np.cos",
    "asin": "np.arcsin",
    "atan2": "np.arctan2",
    "minimum": "np.minimum",
    "maximum": "np.maximum",
    "where": "np.where",
    "clip": "np.clip",
    "known_or": "known_or",
    "abs": "np.abs",
}
"""Functions of `quadctl.numeric` in what is written."""
_OURS = (__file__, numeric.__file__)
"""Files whose local variables are none of the effect's."""


@dataclass(frozen=True, eq=False)
class Node:
    """One operation, or a name or number without parts."""

    does: str
    """Sign, function, or the name or number itself."""
    parts: "tuple[Node, ...]" = ()

    @property
    def strength(self) -> int:
        if not self.parts:
            return _NEGATES if self.does.startswith("-") else _CALLS
        return _STRENGTH.get(self.does, _CALLS)

    @property
    def size(self) -> int:
        """Number of operations."""
        return bool(self.parts) + sum(part.size for part in self.parts)


class _Arithmetic:
    """Operators of terms."""

    node: Node

    def __add__(self, other: Any) -> Any:
        return _joined("+", self, other)

    def __radd__(self, other: Any) -> Any:
        return _joined("+", other, self)

    def __sub__(self, other: Any) -> Any:
        return _joined("-", self, other)

    def __rsub__(self, other: Any) -> Any:
        return _joined("-", other, self)

    def __mul__(self, other: Any) -> Any:
        return _joined("*", self, other)

    def __rmul__(self, other: Any) -> Any:
        return _joined("*", other, self)

    def __truediv__(self, other: Any) -> Any:
        return _joined("/", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return _joined("/", other, self)

    def __pow__(self, other: Any) -> Any:
        return _joined("**", self, other)

    def __rpow__(self, other: Any) -> Any:
        return _joined("**", other, self)

    def __neg__(self) -> Any:
        return _applied("neg", operator.neg, self)

    def __pos__(self) -> Any:
        return self

    def __abs__(self) -> Any:
        return _applied("abs", abs, self)


class Symbol(_Arithmetic):
    """Term whose value is not known."""

    def __init__(self, node: Node | str) -> None:
        self.node = Node(node) if isinstance(node, str) else node

    def __gt__(self, other: Any) -> Any:
        return _joined(">", self, other)

    def __ge__(self, other: Any) -> Any:
        return _joined(">=", self, other)

    def __lt__(self, other: Any) -> Any:
        return _joined("<", self, other)

    def __le__(self, other: Any) -> Any:
        return _joined("<=", self, other)

    def __bool__(self) -> bool:
        raise TypeError("a choice by what is not known yet")

    def __float__(self) -> float:
        raise TypeError("a number of what is not known yet")


class Named(_Arithmetic, float):  # type: ignore[misc]  # its powers are terms, too
    """Number that is known and has a name, or is computed from such."""

    def __new__(cls, value: float, node: Node | str) -> "Named":
        made = super().__new__(cls, value)
        made.node = Node(node) if isinstance(node, str) else node
        return made

    def __init__(self, value: float, node: Node | str) -> None:
        del value, node


Term: TypeAlias = Symbol | Named
_OPERATORS: dict[str, Callable[[Any, Any], Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "**": operator.pow,
    ">": operator.gt,
    ">=": operator.ge,
    "<": operator.lt,
    "<=": operator.le,
}


def node_of(value: Any) -> Node:
    """Node of a term or a number."""
    if isinstance(value, _Arithmetic):
        return value.node
    if not math.isfinite(value):
        return Node("np.nan" if math.isnan(value) else f"{'-' if value < 0.0 else ''}np.inf")
    return Node(repr(value) if isinstance(value, int) else repr(float(value)))


def _joined(sign: str, a: Any, b: Any) -> Any:
    for value in (a, b):
        if not isinstance(value, _Arithmetic | int | float):
            return NotImplemented
    short = _shortened(sign, a, b)
    return _applied(sign, _OPERATORS[sign], a, b) if short is None else short


def _shortened(sign: str, a: Any, b: Any) -> Any:
    """Result of adding 0, or of multiplying by 1 or 0; None where all is to be written."""
    zero_a, zero_b, one_a, one_b = (_is(value, number) for number in (0.0, 1.0) for value in (a, b))
    if sign == "*" and (zero_a or zero_b):
        return 0.0
    if (sign == "+" and zero_b) or (sign == "-" and zero_b) or (sign in "*/" and one_b and not _is_choice(a)):
        return a
    if (sign == "+" and zero_a) or (sign == "*" and one_a and not _is_choice(b)):
        return b
    return -b if sign == "-" and zero_a else None


def _is(value: Any, number: float) -> bool:
    return not isinstance(value, _Arithmetic) and value == number


def _is_choice(value: Any) -> bool:
    """True for yes or no, which a multiplication by 1 makes a number."""
    return isinstance(value, Symbol) and value.node.strength == _COMPARES


def _applied(does: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """The term of a function of terms and numbers; a known number where all arguments are known."""
    node = Node(does, tuple(node_of(argument) for argument in arguments))
    if any(isinstance(argument, Symbol) for argument in arguments):
        return Symbol(node)
    return Named(function(*(float.__float__(float(argument)) for argument in arguments)), node)


def _of_numeric(name: str, *arguments: Any) -> Any:
    """A function of `quadctl.numeric`, applied to terms."""
    return _applied(name, getattr(numeric, name), *arguments)


SYMBOLIC[Symbol] = SYMBOLIC[Named] = _of_numeric


class Renamed:
    """An object whose numbers are `Named` as constants, after the attributes that hold them."""

    def __init__(self, target: Any, prefix: str, used: dict[str, Any]) -> None:
        """`used` takes in each constant that is read, with its value."""
        self._target, self._prefix, self._used = target, prefix, used

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._target, name)
        full = f"{self._prefix}{name}".upper()
        if isinstance(value, float):
            self._used[full] = value
            return Named(value, full)
        if isinstance(value, tuple) and value and isinstance(value[0], tuple):
            self._used[full] = [list(row) for row in value]
            return tuple(
                tuple(Named(part, f"{full}[{i}, {j}]") for j, part in enumerate(row)) for i, row in enumerate(value)
            )
        if isinstance(value, tuple) and value and not isinstance(value[0], float):
            return tuple(_Item(value, i, f"{full}_", self._used) for i in range(len(value)))
        if isinstance(value, tuple) and value:
            self._used[full] = list(value)
            return tuple(Named(part, f"{full}[{i}]") for i, part in enumerate(value))
        if isinstance(value, BaseModel):
            return Renamed(value, f"{full}_", self._used)
        return value


class _Item(Renamed):
    """One of several objects of a kind, whose numbers are in one array for each attribute."""

    def __init__(self, targets: Sequence[Any], i: int, prefix: str, used: dict[str, Any]) -> None:
        super().__init__(targets[i], prefix, used)
        self._targets, self._i = targets, i

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._target, name)
        full = f"{self._prefix}{name}".upper()
        if isinstance(value, float):
            self._used[full] = [getattr(target, name) for target in self._targets]
            return Named(value, f"{full}[{self._i}]")
        if isinstance(value, tuple) and all(isinstance(part, float) for part in value):
            self._used[full] = [list(getattr(target, name)) for target in self._targets]
            return tuple(Named(part, f"{full}[{self._i}, {j}]") for j, part in enumerate(value))
        return value


@dataclass
class Names:
    """Names that local variables of an effect's code gave to terms."""

    of: dict[Node, str] = field(default_factory=dict)

    @contextmanager
    def noted(self) -> Iterator[None]:
        """Note the local variables of each function that ends meanwhile."""

        def note(frame: FrameType, event: str, _: Any) -> None:
            if event == "return" and frame.f_code.co_filename not in _OURS:
                for name, value in frame.f_locals.items():
                    if isinstance(value, _Arithmetic) and name.isidentifier():
                        self.of.setdefault(value.node, name.strip("_").lower())

        before = sys.getprofile()
        sys.setprofile(note)
        try:
            yield
        finally:
            sys.setprofile(before)


LEAST_NAMED, LEAST_REPEATED = 1, 3
"""Least number of operations of what becomes a local variable: where the effect's code has named it, and where it is
used more than once."""


def written(results: Sequence[Any], names: Names, taken: Iterable[str]) -> tuple[list[str], list[str]]:
    """Assignments of local variables, and the expressions of the results, which use them.

    `taken` holds the names that mean something else.
    """
    nodes = [node_of(result) for result in results]
    merged: dict[tuple[str, tuple[Node, ...]], Node] = {}
    called: dict[Node, str] = {}
    nodes = [_merged(node, merged, names, called) for node in nodes]
    uses: dict[Node, int] = {}
    for node in nodes:
        _count(node, uses)
    lines: list[str] = []
    text: dict[Node, str] = {}
    used = {*taken}
    for node, times in uses.items():  # parts come before what they are parts of
        own = called.get(node)
        worth = node.size >= LEAST_NAMED if own else times > 1 and node.size >= LEAST_REPEATED
        if not node.parts or not worth or (node in nodes and times == 1):
            continue
        variable = _free(own or "part", used)
        lines.append(f"{variable} = {_text(node, text)}")
        text[node] = variable
    return lines, [_text(node, text) for node in nodes]


def _merged(node: Node, known: dict[tuple[str, tuple[Node, ...]], Node], names: Names, called: dict[Node, str]) -> Node:
    """The same node for the same operation on the same parts, with the name that it was given first."""
    parts = tuple(_merged(part, known, names, called) for part in node.parts)
    found = known.setdefault((node.does, parts), Node(node.does, parts))
    if node in names.of:
        called.setdefault(found, names.of[node])
    return found


def _count(node: Node, uses: dict[Node, int]) -> None:
    """Count how often each node is used, in an order in which parts come first."""
    if node in uses:
        uses[node] += 1
        return
    for part in node.parts:
        _count(part, uses)
    uses[node] = 1


def _free(name: str, used: set[str]) -> str:
    """The name, numbered where it is taken; it is taken from now on."""
    free, number = name, 1
    while free in used:
        number += 1
        free = f"{name}_{number}"
    used.add(free)
    return free


def _text(node: Node, text: Mapping[Node, str], least: int = _COMPARES) -> str:
    """Expression of a node, in brackets where it binds less than `least`."""
    if node in text:
        return text[node]
    if not node.parts:
        return node.does if node.strength >= least else f"({node.does})"
    if node.does == "neg":
        found = f"-{_text(node.parts[0], text, _NEGATES)}"
    elif node.does in _NUMPY:
        found = f"{_NUMPY[node.does]}({', '.join(_text(part, text) for part in node.parts)})"
    else:
        left, right = node.parts
        own = node.strength
        # All associate to the left but the power, whose base is bracketed where it is more than a name.
        before, after = (own + 1, own) if node.does == "**" else (own, own + 1)
        found = f"{_text(left, text, before)} {node.does} {_text(right, text, after)}"
    return f"({found})" if node.strength < least else found
