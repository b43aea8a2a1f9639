"""The commands on the pages about other systems, on samples of these systems."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from command_line import run

PAGES = Path(__file__).parents[1] / "docs" / "sources"
DATA = Path(__file__).parents[2] / "shared" / "data" / "sparse_maps"
pytestmark = pytest.mark.skipif(not PAGES.is_dir(), reason="docs are not beside the tests")
COMMAND = re.compile(r"^groundmap .*$", re.MULTILINE)
SAMPLES = {
    "colmap.md": ("sparse/0", "colmap_kitti06_mono"),
    "orbslam.md": ("corridor", "orbslam2_webcam"),
    "photos.md": ("bundle.out", "bundler_balbianello/bundle.out"),
    "ros.md": ("drive_bag", "ros2_kitti_raw_vo_mcap"),
    "rtabmap.md": ("rtabmap.db", "rtabmap_small/one_node_rgbd.db"),
    "stella.md": ("map.msg", "stella_room_equirect/mymap.msg"),
}


@pytest.mark.parametrize("page", sorted(SAMPLES))
def test_at_most_five_commands_lead_from_the_files_to_a_map(page: str) -> None:
    commands = COMMAND.findall((PAGES / page).read_text())
    assert 3 <= len(commands) <= 5
    assert any(command.startswith("groundmap map ") for command in commands)


@pytest.mark.skipif(not DATA.is_dir(), reason=f"no samples in {DATA}")
@pytest.mark.parametrize("page", sorted(SAMPLES))
def test_the_commands_of_a_page_work_on_a_sample(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, sample = SAMPLES[page]
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).symlink_to(DATA / sample)
    monkeypatch.chdir(tmp_path)
    for command in COMMAND.findall((PAGES / page).read_text()):
        ran = run(*shlex.split(command)[1:])
        assert ran.code == 0, f"{command}: {ran.err}"


def test_every_page_is_in_the_contents() -> None:
    contents = (PAGES / "index.md").read_text()
    listed = re.search(r"hidden:\n\n([\w\n]+)```", contents)
    assert listed is not None
    assert {page.stem for page in PAGES.glob("*.md")} - {"index"} == set(listed[1].split())
