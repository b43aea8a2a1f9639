"""Print the size of the code: rooms with purpose, modules with layer, lines and public names."""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path
from statistics import median
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
LARGE = 300  # lines; longer modules are flagged
LONGEST = 10  # number of functions listed at the end
Function = tuple[int, str]  # lines, name


class Module(NamedTuple):
    """Sizes of one file."""

    name: str
    layer: int
    lines: int
    functions: list[Function]
    public: list[str]


class Room(NamedTuple):
    """A package and the modules directly in it."""

    name: str
    purpose: str
    modules: list[Module]


def main() -> None:
    """Print one table per room, totals, and the longest functions."""
    rooms = [room for package in ("groundmap", "planners") for room in measure(package)]
    for room in rooms:
        print_room(room)
    for package in ("groundmap", "planners"):
        inside = [room for room in rooms if room.name.partition(".")[0] == package]
        measured = [module for room in inside for module in room.modules]
        lines = [module.lines for module in measured]
        lengths = [length for module in measured for length, _ in module.functions]
        print(
            f"{package}: {len(inside)} rooms, {len(lines)} modules, {sum(lines)} lines "
            f"(median {median(lines or [0]):g}); {len(lengths)} functions "
            f"(median {median(lengths or [0]):g} lines)"
        )
    functions = [f for room in rooms for module in room.modules for f in module.functions]
    for length, name in sorted(functions, reverse=True)[:LONGEST]:
        print(f"{length:>5} {name}")


def print_room(room: Room) -> None:
    """Print the total of a room, and a table of its modules."""
    total = sum(module.lines for module in room.modules)
    print(f"{room.name}  {len(room.modules)} modules, {total} lines. {room.purpose}")
    for module in sorted(room.modules, key=lambda module: (-module.layer, module.name)):
        length, longest = max(module.functions, default=(0, ""))
        flag = f"  over {LARGE} lines" if module.lines > LARGE else ""
        print(
            f"  {module.name:<24}layer {module.layer:>2}{module.lines:>6} lines"
            f"{len(module.functions):>4} functions, longest {length:>3} "
            f"{longest.rpartition('.')[2]}{flag}"
        )
        print(f"    {', '.join(module.public)}")
    print()


def measure(package: str) -> list[Room]:
    """Return the rooms of a package; files whose name begins with an underscore do not count."""
    layers = layers_by_module()
    rooms = []
    for init in sorted((ROOT / package).rglob("__init__.py")):
        room = ".".join(init.parent.relative_to(ROOT).parts)
        docstring = ast.get_docstring(ast.parse(init.read_text(encoding="utf-8"))) or ""
        modules = [measure_module(path, room, layers) for path in init.parent.glob("[!_]*.py")]
        rooms.append(Room(room, docstring.partition("\n\n")[0].replace("\n", " "), modules))
    return rooms


def measure_module(path: Path, room: str, layers: dict[str, int]) -> Module:
    """Measure one file."""
    name = f"{room}.{path.stem}"
    source = path.read_text(encoding="utf-8")
    tree = ast.parse(source)
    defined = [n.name for n in tree.body if isinstance(n, ast.FunctionDef | ast.ClassDef)]
    functions = [
        ((node.end_lineno or node.lineno) - node.lineno + 1, f"{name}.{node.name}")
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
    ]
    public = [name for name in defined if not name.startswith("_")]
    return Module(path.stem, layers.get(name, 0), len(source.splitlines()), functions, public)


def layers_by_module() -> dict[str, int]:
    """Return the layer of each module in the import contract of its room; 1 is the lowest.

    Modules of rooms without a contract are left out.
    """
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = {}
    for contract in settings["tool"]["importlinter"]["contracts"]:
        for container in contract.get("containers", []):
            for number, row in enumerate(reversed(contract["layers"]), start=1):
                for name in row.split("|"):
                    layers[f"{container}.{name.strip(' ()')}"] = number
    return layers


if __name__ == "__main__":
    main()
