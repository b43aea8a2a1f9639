"""Check that public functions with several parameters document each of them, as numpydoc has it.

A property, a test and a command (its options carry help texts) needs no Parameters section.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

from numpydoc.docscrape import NumpyDocString

ROOT = Path(__file__).parent.parent
PACKAGES = ("groundmap", "planners")
COMMANDS = ROOT / "planners" / "commands"


def main() -> None:
    """Print each fault with its place; exit with 1 if there is any."""
    files = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    faults = [fault for path in files if COMMANDS not in path.parents for fault in faults_in(path)]
    for fault in faults:
        print(fault)
    print(f"{len(files)} files, {len(faults)} functions without complete Parameters sections")
    sys.exit(bool(faults))


def faults_in(path: Path) -> list[str]:
    """Return a line for each public function of a file whose parameters are not documented."""
    faults = []
    for function in public_functions(ast.parse(path.read_text(encoding="utf-8"))):
        names, documented = parameters_of(function), documented_in(function)
        if len(names) > 1 and names != documented:
            place = f"{path.relative_to(ROOT)}:{function.lineno}"
            faults.append(
                f"{place}: {function.name}: expected Parameters {', '.join(names)}, "
                f"got {', '.join(documented) or 'none'}"
            )
    return faults


def public_functions(node: ast.AST) -> Iterator[ast.FunctionDef]:
    """Yield the public functions of a module, and the public methods of its public classes."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.ClassDef) and not child.name.startswith("_"):
            if isinstance(child, ast.FunctionDef):
                yield child
            else:
                yield from public_functions(child)


def parameters_of(function: ast.FunctionDef) -> list[str]:
    """Return the names of a function's parameters, as numpydoc writes them."""
    arguments = function.args
    plain = [*arguments.posonlyargs, *arguments.args]
    names = [argument.arg for argument in plain if argument.arg not in ("self", "cls")]
    names += [f"*{arguments.vararg.arg}"] if arguments.vararg else []
    names += [argument.arg for argument in arguments.kwonlyargs]
    names += [f"**{arguments.kwarg.arg}"] if arguments.kwarg else []
    return names


def documented_in(function: ast.FunctionDef) -> list[str]:
    """Return the names in the Parameters section of a function's docstring, one by one."""
    docstring = NumpyDocString(ast.get_docstring(function) or "")
    return [name for entry in docstring["Parameters"] for name in entry.name.split(", ")]


if __name__ == "__main__":
    main()
