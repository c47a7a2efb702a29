"""Draw which part of the code imports which: the pictures and the counts of docs/architecture.md.

A room is a package of `quadctl`, or a module that stands beside the packages. `make architecture` reads the imports
with grimp (the library under import-linter), draws one picture for all of `quadctl` and one for each large package, and
writes what stands between the marks on the page.
"""

import ast
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from graphlib import TopologicalSorter
from itertools import pairwise
from xml.sax.saxutils import escape

import grimp

from studies.page import DOCS, ROOT

PAGE = DOCS / "architecture.md"
PACKAGES = ("quadctl", "quadctl.lab", "quadctl.flight", "quadctl.web", "quadctl.sitl")
"""Packages that have a picture."""
BASE = "base"
BASE_MODULES = ("errors", "files", "frames", "numeric", "settings", "state")
"""Small modules at the top level that nearly every room uses: one room in the picture."""

Graph = Mapping[str, frozenset[str]]
"""Names that each room, or each module, imports."""

ROW_PX, GAP_PX, MARGIN_PX, BOX_PX, LETTER_PX = 84, 18, 16, 34, 8.2


@dataclass(frozen=True)
class Rooms:
    """The rooms of one package and the imports between them."""

    package: str
    imports: Graph
    docstring: Mapping[str, str]
    """First sentence of each room's docstring."""

    @property
    def picture(self) -> str:
        """File name of the picture."""
        return "architecture.svg" if self.package == "quadctl" else f"architecture-{self.package.split('.')[-1]}.svg"

    @property
    def arrows(self) -> int:
        """Number of pairs of rooms of which one imports the other."""
        return sum(map(len, self.imports.values()))


def module_imports() -> Graph:
    """Read the imports of all modules of `quadctl`, those inside functions included."""
    graph = grimp.build_graph("quadctl", cache_dir=None)
    return {module: frozenset(graph.find_modules_directly_imported_by(module)) for module in graph.modules}


def rooms_of(package: str, modules: Graph) -> Rooms:
    """Gather the modules below `package` into rooms, one for each direct child."""
    imports: dict[str, set[str]] = defaultdict(set)
    for importer, imported in modules.items():
        room = _room(importer, package)
        if room is None:
            continue
        imports[room] |= {other for other in (_room(module, package) for module in imported) if other}
    sentences = {room: _first_sentence(package, room) for room in imports}
    return Rooms(package, {room: frozenset(found - {room}) for room, found in imports.items()}, sentences)


def circles(imports: Graph) -> list[list[str]]:
    """Find the groups of rooms or modules in which each leads to each other: strongly connected components."""
    reached = {name: _reachable(name, imports) for name in imports}
    groups = {frozenset({name} | {o for o in reached[name] if name in reached[o]}) for name in imports}
    return sorted(sorted(group) for group in groups if len(group) > 1)


def without_implied(imports: Graph) -> dict[str, set[str]]:
    """Leave out each arrow that a longer way implies (transitive reduction); arrows of a circle all stay."""
    reached = {name: _reachable(name, imports) for name in imports}
    kept: dict[str, set[str]] = {}
    for name, found in imports.items():
        onward = {far for near in found if name not in reached[near] for far in reached[near]}
        kept[name] = {other for other in found if other not in onward or name in reached[other]}
    return kept


def drawn(rooms: Rooms) -> str:
    """Draw the rooms as SVG: each stands above all that it imports; arrows of a circle are red."""
    together = {room: frozenset(circle) for circle in circles(rooms.imports) for room in circle}
    arrows = without_implied(rooms.imports)
    upright = {a: {b for b in found if a not in together or b not in together[a]} for a, found in arrows.items()}
    rows, chains = _rows(upright)
    width, x = _places(rows)
    height = len(rows) * ROW_PX - (ROW_PX - BOX_PX) + 2 * MARGIN_PX
    y = {name: height - MARGIN_PX - BOX_PX / 2 - level * ROW_PX for level, row in enumerate(rows) for name in row}
    parts = [_path([(x[p], y[p]) for p in chain], "arrow") for chain in chains]
    for a, found in arrows.items():
        parts += [_path([(x[a], y[a]), (x[b], y[b])], "circle") for b in sorted(found - upright[a])]
    for name in sorted(rooms.imports):
        w, label = _width(name), escape(name)
        parts.append(
            f'<g><title>{escape(rooms.docstring[name])}</title><rect x="{x[name] - w / 2:.0f}" '
            f'y="{y[name] - BOX_PX / 2:.0f}" width="{w:.0f}" height="{BOX_PX}" rx="6"/>'
            f'<text x="{x[name]:.0f}" y="{y[name] + 4.5:.0f}">{label}</text></g>'
        )
    return _SVG.format(width=round(width), height=round(height), body="\n".join(parts), package=rooms.package)


def tables(every: Sequence[Rooms], modules: Graph) -> str:
    """Write the counts, and the pictures of all packages but the first, as Markdown."""
    cycles = ", ".join(f"`{r.package}` {_in_words(circles(r.imports))}" for r in every if circles(r.imports)) or "none"
    lines = [f"Import cycles of rooms: {cycles}; of single modules: {_sizes(circles(modules))}."]
    for rooms in every[1:]:  # the picture of the first is at the top of the page
        lines += ["", f"![Imports between the rooms of {rooms.package}]({rooms.picture})"]
    return "\n".join(lines)


def written(page: str, text: str) -> str:
    """The page with `text` between its marks."""
    before, begin, rest = page.partition("<!-- rooms: written by `make architecture` -->")
    _, end, after = rest.partition("<!-- end of rooms -->")
    return f"{before}{begin}\n\n{text}\n\n{end}{after}"


def main() -> None:
    """Write the pictures, and the tables on the page."""
    modules = module_imports()
    every = [rooms_of(package, modules) for package in PACKAGES]
    for rooms in every:
        (PAGE.parent / rooms.picture).write_text(drawn(rooms), encoding="utf-8")
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8"), tables(every, modules)), encoding="utf-8")
    for rooms in every:
        print(
            f"{rooms.package}: {len(rooms.imports)} rooms, {rooms.arrows} arrows, {len(circles(rooms.imports))} circles"
        )
    print(f"circles of single modules: {len(circles(modules))}")


# --- inside --------------------------------------------------------------------------------------------------------


def _room(module: str, package: str) -> str | None:
    """Name of the room of `package` that holds `module`; None for a module outside of it."""
    if not module.startswith(f"{package}."):
        return None
    name = module.removeprefix(f"{package}.").split(".")[0]
    return BASE if package == "quadctl" and name in BASE_MODULES else name


def _first_sentence(package: str, room: str) -> str:
    """First sentence of the room's docstring; empty where it has none."""
    if room == BASE:
        return f"Small modules that every room may use: {', '.join(f'`{module}`' for module in BASE_MODULES)}."
    place = ROOT.joinpath(*package.split("."))
    file = place / room / "__init__.py" if (place / room).is_dir() else place / f"{room}.py"
    text = " ".join((ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").split("\n\n")[0].split())
    return re.split(r"(?<=[.?!]) ", text)[0].replace("|", "\\|")


def _reachable(start: str, imports: Mapping[str, Iterable[str]]) -> set[str]:
    """Everything that `start` imports, directly or not."""
    found: set[str] = set()
    to_visit = list(imports[start])
    while to_visit:
        name = to_visit.pop()
        if name not in found:
            found.add(name)
            to_visit += imports.get(name, ())
    return found


def _rows(upright: Mapping[str, set[str]]) -> tuple[list[list[str]], list[list[str]]]:
    """Arrange the names in rows, lowest first, and each arrow as a chain of points with one in every row it crosses.

    A point that is not the end of an arrow is named `a>b:row`; its place in the row keeps the arrow clear of the boxes.
    """
    level: dict[str, int] = {}
    for name in TopologicalSorter(upright).static_order():
        level[name] = 1 + max((level[other] for other in upright[name]), default=-1)
    rows: list[list[str]] = [[] for _ in range(1 + max(level.values()))]
    for name in sorted(level):
        rows[level[name]].append(name)
    chains = []
    for a in sorted(upright):
        for b in sorted(upright[a]):
            between = [f"{a}>{b}:{row}" for row in range(level[a] - 1, level[b], -1)]
            for row, point in zip(range(level[a] - 1, level[b], -1), between, strict=True):
                rows[row].append(point)
            chains.append([a, *between, b])
    neighbours = defaultdict(list)
    for chain in chains:
        for upper, lower in pairwise(chain):
            neighbours[upper].append(lower)
            neighbours[lower].append(upper)
    # Fewer crossings: each name moves to the mean place of its neighbours in the next row, from both sides in turn.
    for sweep in range(24):
        order = range(1, len(rows)) if sweep % 2 == 0 else range(len(rows) - 2, -1, -1)
        for row in order:
            beside = rows[row - 1 if sweep % 2 == 0 else row + 1]
            place = {name: (i + 0.5) / len(beside) for i, name in enumerate(beside)}
            here = {name: (i + 0.5) / len(rows[row]) for i, name in enumerate(rows[row])}
            means = {}
            for name in rows[row]:
                near = [place[other] for other in neighbours[name] if other in place]
                means[name] = sum(near) / len(near) if near else here[name]
            rows[row].sort(key=means.__getitem__)
    return rows, chains


def _places(rows: Sequence[Sequence[str]]) -> tuple[float, dict[str, float]]:
    """Width of the picture, and the horizontal place of each name, its row spread over the width."""
    needed = [sum(map(_width, row)) + GAP_PX * (len(row) - 1) for row in rows]
    width = max(needed) + 2 * MARGIN_PX
    x: dict[str, float] = {}
    for row, taken in zip(rows, needed, strict=True):
        spare = (width - 2 * MARGIN_PX - taken) / (len(row) + 1)
        left = MARGIN_PX + spare
        for name in row:
            x[name] = left + _width(name) / 2
            left += _width(name) + GAP_PX + spare
    return width, x


def _width(name: str) -> float:
    """Width of the box of a room, or of a point that only leads an arrow, px."""
    return 4.0 if ">" in name else LETTER_PX * len(name) + 20.0


def _path(points: Sequence[tuple[float, float]], kind: str) -> str:
    """A smooth line through the points, from the edge of the upper box to the edge of the lower one."""
    (x, y), *middle, (last_x, last_y) = points
    y += BOX_PX / 2 if last_y > y else -BOX_PX / 2 if last_y < y else 0.0
    end_y = last_y - BOX_PX / 2 - 3 if last_y > y else last_y + BOX_PX / 2 + 3
    line = f"M{x:.0f} {y:.0f}"
    for to_x, to_y in [*middle, (last_x, end_y)]:
        half = (y + to_y) / 2
        line += f" C{x:.0f} {half:.0f} {to_x:.0f} {half:.0f} {to_x:.0f} {to_y:.0f}"
        x, y = to_x, to_y
    return f'<path class="{kind}" d="{line}" marker-end="url(#{kind}-head)"/>'


def _sizes(found: Sequence[Sequence[str]]) -> str:
    """Number of circles, and the package and the number of modules of each."""
    each = [f"{len(circle)} modules around `{circle[0]}`" for circle in found]
    return f"{len(found)} ({'; '.join(each)})" if found else "0"


def _in_words(found: Sequence[Sequence[str]]) -> str:
    """Number of circles, and the rooms of each."""
    return (
        f"{len(found)} ({'; '.join(' - '.join(f'`{name}`' for name in circle) for circle in found)})" if found else "0"
    )


_SVG = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}">
<title>Imports between the rooms of {package}</title>
<style>
rect.paper {{ fill: #ffffff }}
g rect {{ fill: #e8eef7; stroke: #48658f }}
text {{ font: 14px ui-sans-serif, Helvetica, Arial, sans-serif; fill: #14202f; text-anchor: middle }}
path.arrow {{ fill: none; stroke: #7d8ea6; stroke-width: 1.3 }}
path.circle {{ fill: none; stroke: #c0392b; stroke-width: 1.8 }}
.arrow-tip {{ fill: #7d8ea6 }}
.circle-tip {{ fill: #c0392b }}
</style>
<defs>
<marker id="arrow-head" markerWidth="7" markerHeight="7" refX="5" refY="3" orient="auto">
<path class="arrow-tip" d="M0 0 L6 3 L0 6 z"/></marker>
<marker id="circle-head" markerWidth="7" markerHeight="7" refX="5" refY="3" orient="auto">
<path class="circle-tip" d="M0 0 L6 3 L0 6 z"/></marker>
</defs>
<rect class="paper" width="{width}" height="{height}"/>
{body}
</svg>
"""

if __name__ == "__main__":
    main()
