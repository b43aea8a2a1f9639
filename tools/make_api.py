"""Write the index pages of the API reference: each public name once, with a page of its own."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType

#: In the order of the contents; a name that several modules hand on belongs to the first.
MODULES = (
    "groundmap",
    "groundmap.io",
    "groundmap.draw",
    "groundmap.simulate",
    "groundmap.errors",
    "planners",
)


def main(folder: Path) -> None:
    """Write `folder`/<module>.rst for each module."""
    folder.mkdir(parents=True, exist_ok=True)
    for module, names in public_names().items():
        (folder / f"{module}.rst").write_text(page(module, names), encoding="utf-8")


def public_names() -> dict[str, list[str]]:
    """Return the public names by module, each object once."""
    seen: set[int] = set()
    names: dict[str, list[str]] = {}
    for module in MODULES:
        loaded = importlib.import_module(module)
        names[module] = [name for name in exported(loaded) if id(getattr(loaded, name)) not in seen]
        seen |= {id(getattr(loaded, name)) for name in names[module]}
    return names


def exported(module: ModuleType) -> list[str]:
    """Return a module's ``__all__``; without one, the classes that it defines."""
    if hasattr(module, "__all__"):
        return list(module.__all__)
    return [name for name, kind in vars(module).items() if is_defined_in(module, kind)]


def is_defined_in(module: ModuleType, kind: object) -> bool:
    """Return whether an object is a class that a module defines.

    Parameters
    ----------
    module : module
    kind : object
    """
    return isinstance(kind, type) and kind.__module__ == module.__name__


def page(module: str, names: list[str]) -> str:
    """Return the index page of one module, in reStructuredText.

    Parameters
    ----------
    module : str
    names : list of str
        Its public names.
    """
    lines = [module, "=" * len(module), "", f".. automodule:: {module}", "", ".. autosummary::"]
    lines += ["   :toctree: generated", "", *(f"   {name}" for name in names), ""]
    return "\n".join(lines)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
