"""Ctrl-C and SIGTERM at any time: one line, an exit code, and no leftovers."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import time
from importlib.resources import files
from pathlib import Path

import pytest

from command_line import run
from groundmap import read_views, write_views

MAIN = "from planners.cli import main; main()"
# Stops at a certain import, without a dependence on time.
DURING_IMPORT = """
import builtins, sys
from planners.cli import main
imported = builtins.__import__
def stop(name, *rest):
    if name == {module!r}:
        print("there", flush=True)
        import time
        time.sleep(60)
    return imported(name, *rest)
builtins.__import__ = stop
main()
"""
SIGNALS = [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "terminated")]

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")


def start(*arguments: str | Path, script: str = MAIN) -> subprocess.Popen[str]:
    """Start the command in a new session."""
    return subprocess.Popen(
        [sys.executable, "-c", script, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def others_in_session(leader: int) -> list[int]:
    """Return the processes of a session, but for its leader."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
        except OSError:  # it has ended in the meantime
            continue
        if int(fields[3]) == leader and fields[0] != "Z" and int(folder.name) != leader:
            found.append(int(folder.name))
    return found


def check_ended(process: subprocess.Popen[str], number: signal.Signals, word: str) -> None:
    out, err = process.communicate(timeout=60)
    messages = "running scenarios", "ground 1."  # of the work before the signal
    lines = [line for line in err.splitlines() if not line.startswith(messages)]
    assert (process.returncode, lines, out) == (128 + number, [f"groundmap: {word}"], "")
    while others_in_session(process.pid):  # killed, or about to end without a parent
        time.sleep(0.05)


@pytest.mark.parametrize(("number", "word"), SIGNALS)
@pytest.mark.parametrize("module", ["typer", "numba", "planners.commands.scenario"])
def test_a_signal_during_the_imports_ends_the_command(
    number: signal.Signals, word: str, module: str
) -> None:
    process = start("info", "map.npz", script=DURING_IMPORT.format(module=module))
    assert process.stdout is not None
    assert process.stdout.readline() == "there\n"
    os.kill(process.pid, number)
    check_ended(process, number, word)


@pytest.mark.parametrize(("number", "word"), SIGNALS)
def test_a_signal_while_a_file_is_written_leaves_none(
    number: signal.Signals, word: str, tmp_path: Path
) -> None:
    log, out = tmp_path / "views", tmp_path / "out"
    write_views(itertools.islice(read_views(str(files("planners") / "demo_data")), 2), log)
    out.mkdir()
    script = (
        "import os\nfsync = os.fsync\n"
        "def stop(handle):\n print('there', flush=True)\n import time\n time.sleep(60)\n"
        f"os.fsync = stop\n{MAIN}"
    )
    process = start("map", log, "--out", out / "map.npz", script=script)
    assert process.stdout is not None
    assert process.stdout.readline() == "there\n"
    assert list(out.iterdir())
    os.kill(process.pid, number)
    check_ended(process, number, word)
    assert not list(out.iterdir())


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="processes are looked for in /proc")
@pytest.mark.parametrize(("number", "word"), SIGNALS)
def test_workers_end_with_the_command(number: signal.Signals, word: str, tmp_path: Path) -> None:
    for name in ("one", "two"):
        assert run("scenario", "new", name, "--folder", tmp_path).code == 0
    process = start("scenario", "run", tmp_path, "--jobs", "2")
    while len(others_in_session(process.pid)) < 3:  # two workers and the resource tracker
        assert process.poll() is None
        time.sleep(0.02)
    if number == signal.SIGINT:
        os.killpg(process.pid, number)  # as a terminal does
    else:
        os.kill(process.pid, number)
    check_ended(process, number, word)
