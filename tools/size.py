"""Print how large the code is: per module its layer, lines, functions and public names."""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path
from statistics import median
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
LARGE = 300  # [lines], from here on a module is flagged
LONGEST = 10  # functions listed at the end
Function = tuple[int, str]  # lines, name


class Module(NamedTuple):
    """What is counted in one file."""

    name: str
    layer: int
    lines: int
    functions: list[Function]
    public: list[str]


def main() -> None:
    """Print one table per package, and the longest functions of both."""
    modules = {package: measure(package) for package in ("groundmap", "planners")}
    for package, measured in modules.items():
        print(f"{package:<24}{'layer':>6}{'lines':>7}{'functions':>11}  longest function")
        for module in sorted(measured, key=lambda module: (-module.layer, module.name)):
            length, longest = max(module.functions, default=(0, ""))
            flag = f"  over {LARGE} lines" if module.lines > LARGE else ""
            print(
                f"  {module.name:<22}{module.layer:>6}{module.lines:>7}"
                f"{len(module.functions):>11}  {length:>3} {longest}{flag}"
            )
            print(f"    {', '.join(module.public)}")
        lines = [module.lines for module in measured]
        lengths = [length for module in measured for length, _ in module.functions]
        print(
            f"  {len(lines)} modules, {sum(lines)} lines (median {median(lines or [0]):g}); "
            f"{len(lengths)} functions (median {median(lengths or [0]):g} lines)\n"
        )
    everything = [module for measured in modules.values() for module in measured]
    for length, name in sorted((f for m in everything for f in m.functions), reverse=True)[
        :LONGEST
    ]:
        print(f"{length:>5} {name}")


def measure(package: str) -> list[Module]:
    """Measure the modules of a package; its __init__, which only hands on names, is none."""
    layers = layers_of(package)
    modules = []
    for path in sorted((ROOT / package).rglob("[!_]*.py")):
        name = ".".join(path.relative_to(ROOT / package).with_suffix("").parts)
        source = path.read_text(encoding="utf-8")
        tree = ast.parse(source)
        defined = [n.name for n in tree.body if isinstance(n, ast.FunctionDef | ast.ClassDef)]
        functions = [
            ((node.end_lineno or node.lineno) - node.lineno + 1, f"{package}.{name}.{node.name}")
            for node in ast.walk(tree)
            if isinstance(node, ast.FunctionDef)
        ]
        public = [name for name in defined if not name.startswith("_")]
        layer = layers.get(name.partition(".")[0], 0)
        modules.append(Module(name, layer, len(source.splitlines()), functions, public))
    return modules


def layers_of(package: str) -> dict[str, int]:
    """Return the layer of each module, 1 the lowest, as the import contracts have them."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    (layers,) = [c["layers"] for c in contracts if c.get("containers") == [package]]
    numbered = enumerate(reversed(layers), start=1)
    return {name.strip(" ()"): number for number, row in numbered for name in row.split("|")}


if __name__ == "__main__":
    main()
