"""The README's examples run, and print what it says they print."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from groundmap import fit_ground, read_views
from planners import OWN_PLANNERS
from planners.commands.app import app
from planners.sampling.ompl_module import samplers

README = Path(__file__).parents[1] / "README.md"
pytestmark = pytest.mark.skipif(not README.is_file(), reason="README.md is not beside the tests")


def blocks(language: str = "") -> list[str]:
    text = README.read_text(encoding="utf-8")
    return [
        body
        for name, body in re.findall(r"```(\w*)\n(.*?)```", text, re.DOTALL)
        if name == language
    ]


def examples() -> list[tuple[str, str]]:
    """Return the examples in Python, each with the block after it, which is what it prints."""
    text = README.read_text(encoding="utf-8") if README.is_file() else ""
    return re.findall(r"```python\n(.*?)```\s+```\n(.*?)```", text, re.DOTALL)


@pytest.mark.parametrize(
    ("code", "answer"),
    examples(),
    ids=["first", "voxels", "planners", "areas", "sampling"],
)
def test_an_example_prints_its_answer(code: str, answer: str) -> None:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == answer


def test_every_planner_is_in_the_table() -> None:
    _, *tables = README.read_text(encoding="utf-8").split("| planner |")
    listed = [
        re.findall(r"`([^`]+)`", "\n".join(row.split("|")[1] for row in rows.split("\n")[2:]))
        for rows in (table.partition("\n\n")[0] for table in tables)
    ]
    assert [sorted(names) for names in listed] == [sorted(OWN_PLANNERS), sorted(samplers())]


@pytest.mark.parametrize("page", ["settings", "rules"])
def test_the_generated_pages_are_what_the_code_says(page: str) -> None:
    root = README.parent
    made = runpy.run_path(str(root / "tools" / f"make_{page}.py"))["document"]()
    assert (root / "docs" / f"{page}.md").read_text(encoding="utf-8") == made


def test_the_first_example_has_ten_lines_at_most() -> None:
    code = blocks("python")[0]
    assert len([line for line in code.splitlines() if line.strip()]) <= 10


def test_the_log_that_is_shown_can_be_read(tmp_path: Path) -> None:
    (rig,) = blocks("toml")
    poses, points = (block for block in blocks() if block.startswith(("# poses.txt", "view,id")))
    (tmp_path / "rig.toml").write_text(rig)
    (tmp_path / "poses.txt").write_text(poses)
    (tmp_path / "points.csv").write_text(points)
    views = list(read_views(tmp_path))
    assert [len(view.points) for view in views] == [2, 1]
    np.testing.assert_allclose(views[1].T_map_camera[:3, 3], (0.2, 0.0, 0.0), atol=1e-12)
    assert [view.plane is not None for view in fit_ground(views, camera_height=1.0)] == [True] * 2


def test_every_command_is_in_the_table() -> None:
    listed = set(
        re.findall(r"^\| `groundmap (\w+)", README.read_text(encoding="utf-8"), re.MULTILINE)
    )
    groups = {
        group.typer_instance.info.name for group in app.registered_groups if group.typer_instance
    }
    assert listed == {command.name for command in app.registered_commands} | groups
