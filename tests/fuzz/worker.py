"""What a worker process does: load the targets, warm up, run cases, keep the files of failures."""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fuzz.case import FAILURES, outcome_of
from fuzz.draw import Draw
from fuzz.pool import Report


@dataclass(frozen=True)
class Start:
    """Prepares a worker process; pickled, so that the parent need not load what it tests.

    Parameters
    ----------
    seed : int
        Of the run.
    names : tuple of str
        The targets that cases may be of.
    """

    seed: int
    names: tuple[str, ...]

    def __call__(self, folder: Path) -> Callable[[str, int, Path], Report]:
        """Warm up in a folder, and return what runs a case."""
        from fuzz.targets import TARGETS  # noqa: PLC0415 (loads both packages: only in workers)

        logging.disable()
        for name in self.names:
            warm = folder / "warm-up"
            warm.mkdir()
            TARGETS[name].warm_up(warm)
            shutil.rmtree(warm)
        kept = folder / "kept"

        def run(name: str, number: int, case: Path) -> Report:
            os.chdir(case)
            outcome = outcome_of(TARGETS[name], Draw(f"{self.seed}/{name}/{number}"), case)
            files = None
            if outcome.ending in FAILURES:
                files = kept / f"{name}-{number}"
                shutil.copytree(case, files, dirs_exist_ok=True)
            return Report(name, number, outcome.ending, outcome.place, outcome.text, folder=files)

        return run
