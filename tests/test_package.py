"""The public names of the two packages, and the libraries that their import loads."""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

PACKAGES = ["groundmap", "planners"]
HEAVY = ["matplotlib", "ompl"]


@pytest.mark.parametrize("package", PACKAGES)
def test_import_loads_no_heavy_library(package: str) -> None:
    # In a new interpreter: this one may have loaded them for other tests.
    script = f"import sys, {package}; print(*(set({HEAVY}) & sys.modules.keys()))"
    run = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
    assert run.stdout.split() == []


@pytest.mark.parametrize("package", PACKAGES)
def test_public_names_are_sorted(package: str) -> None:
    names = importlib.import_module(package).__all__
    assert names == sorted(set(names))


@pytest.mark.parametrize("package", PACKAGES)
def test_public_names_exist_and_are_documented(package: str) -> None:
    module = importlib.import_module(package)
    missing = [name for name in module.__all__ if not hasattr(module, name)]
    assert missing == []
    undocumented = [name for name in module.__all__ if not _documented(module, name)]
    assert undocumented == []


def _documented(module: object, name: str) -> bool:
    """Return whether a docstring is written, and not the signature that dataclasses generate."""
    text = getattr(module, name).__doc__ or ""
    return bool(text) and not text.startswith(f"{name}(")
