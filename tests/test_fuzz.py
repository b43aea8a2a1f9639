"""The fuzzer itself, and the files that once broke a reader: each is refused, or read."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fuzz.case import Target, check_sentence, outcome_of
from fuzz.draw import Draw
from fuzz.readers import READERS, Archives, Reader, RosMap, Texts
from fuzz.targets import CALLS, FILES, TARGETS
from groundmap.errors import InputError

CORPUS = Path(__file__).parent / "corpus"
ONCE_FAILED = sorted(folder for target in CORPUS.iterdir() for folder in target.iterdir())
BY_NAME = {reader.name: reader for reader in READERS}
SLOW = {"evaluate", "plan-sampling", "roadmaps", "rework", "incremental", "command-plot"}
QUICK = sorted(set(TARGETS) - SLOW)


class Replayed(Reader):
    """Reads files that are there."""

    def __init__(self, reader: Reader) -> None:
        super().__init__(reader.name)
        self._reader = reader

    def files(self, draw: Draw) -> dict[str, bytes]:
        return {}

    def read(self, folder: Path) -> None:
        self._reader.read(folder)


class Raising(Target):
    """Raises what it is given."""

    def __init__(self, error: Exception) -> None:
        super().__init__("raising")
        self._error = error

    def run(self, draw: Draw, folder: Path) -> None:
        raise self._error


@pytest.mark.parametrize(
    "folder", ONCE_FAILED, ids=[f"{path.parent.name}-{path.name}" for path in ONCE_FAILED]
)
def test_what_once_broke_a_reader_is_read_or_refused_with_a_sentence(
    folder: Path, tmp_path: Path
) -> None:
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    outcome = outcome_of(Replayed(BY_NAME[folder.parent.name]), Draw("replay"), tmp_path)
    assert outcome.ending in ("accepted", "refused"), outcome.text


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)
def test_undamaged_samples_are_read(reader: Texts | Archives | RosMap, tmp_path: Path) -> None:
    for name, data in reader.whole().items():
        (tmp_path / name).write_bytes(data)
    reader.read(tmp_path)


@given(name=st.sampled_from(QUICK), number=st.integers(0, 2**32))
def test_no_case_ends_with_an_undocumented_exception(
    tmp_path_factory: pytest.TempPathFactory, name: str, number: int
) -> None:
    folder = tmp_path_factory.mktemp("case")
    outcome = outcome_of(TARGETS[name], Draw(f"{number}"), folder)
    assert outcome.ending in ("accepted", "refused"), outcome.text


@pytest.mark.parametrize("name", ["folder", "map-flat", "problem", "plan"])
def test_a_seed_repeats_its_case(name: str, tmp_path: Path) -> None:
    folders = [tmp_path / "a", tmp_path / "b"]
    records = []
    for folder in folders:
        folder.mkdir()
        draw = Draw("7/case")
        outcome_of(TARGETS[name], draw, folder)
        records.append(draw.record)
    assert [a.split(" at 0x")[0] for a in records[0]] == [b.split(" at 0x")[0] for b in records[1]]
    files = [{path.name: path.read_bytes() for path in folder.iterdir()} for folder in folders]
    assert files[0].keys() == files[1].keys()
    if name in FILES:
        assert files[0] == files[1]


@pytest.mark.parametrize(
    ("error", "ending"),
    [
        (InputError("fx", "a number", "none"), "refused"),
        (KeyError("fx"), "traceback"),
        (RuntimeWarning("overflow"), "traceback"),
        (MemoryError(), "traceback"),
    ],
)
def test_only_documented_exceptions_are_refusals(
    error: Exception, ending: str, tmp_path: Path
) -> None:
    assert outcome_of(Raising(error), Draw(""), tmp_path).ending == ending


@pytest.mark.parametrize("message", ["a\x1b[31m", "\u202e", "two\nlines", "a" * 3000])
def test_messages_are_printable_and_of_bounded_length(message: str) -> None:
    with pytest.raises(Exception, match="a message"):
        check_sentence(message)


def test_the_command_counts_what_it_was_asked_for(tmp_path: Path) -> None:
    options = ["--files", "30", "--calls", "0", "--workers", "1", "--seed", "1"]
    run = subprocess.run(
        [sys.executable, "-m", "fuzz", *options, "--only", "scen", "--keep", tmp_path / "kept"],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "seed 1: 30 cases" in run.stdout, run.stderr
    assert run.returncode == 0
    assert not (tmp_path / "kept").exists()


def test_every_target_is_a_file_target_or_a_call() -> None:
    assert set(TARGETS) == set(FILES) | set(CALLS)
    assert not set(FILES) & set(CALLS)
