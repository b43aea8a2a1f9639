"""Counts of how cases ended, and the failures by where they come from."""

from __future__ import annotations

import shutil
import sys
from collections import Counter, defaultdict
from pathlib import Path

from fuzz.pool import Report

SAY_EVERY = 1000  # cases
KEPT = 3  # failures of one kind whose files are kept
ENDINGS = {
    "traceback": "tracebacks",
    "hang": "hangs",
    "ended": "ended processes",
    "memory": "over memory",
}


class Summary:
    """Counts cases, and keeps the failures.

    Parameters
    ----------
    seed : int
        Of the run.
    keep : Path
        Folder for the failures: made anew by the first one.
    """

    def __init__(self, seed: int, keep: Path) -> None:
        self._seed, self._keep = seed, keep
        self._endings: Counter[str] = Counter()
        self._kinds: defaultdict[tuple[str, str], list[Report]] = defaultdict(list)
        self._peak = 0.0

    @property
    def failures(self) -> int:
        """How many cases failed."""
        return sum(self._endings[ending] for ending in ENDINGS)

    def add(self, report: Report) -> None:
        """Count a case; keep its files if it failed."""
        self._endings[report.ending] += 1
        self._peak = max(self._peak, report.megabytes)
        if self._endings.total() % SAY_EVERY == 0:
            print(f"{self._endings.total()} cases, {self.failures} failures", file=sys.stderr)
        if report.ending not in ENDINGS:
            return
        kind = self._kinds[report.ending, report.place]
        if not any(known.target == report.target for known in kind) or len(kind) < KEPT:
            self._save(report)
        kind.append(report._replace(text=report.text if len(kind) < KEPT else ""))

    def print(self) -> None:
        """Print a line for each kind of failure, and one for all cases."""
        for (ending, place), reports in sorted(self._kinds.items(), key=lambda item: -len(item[1])):
            first = reports[0]
            targets = ", ".join(sorted({report.target for report in reports})[:6])
            last = first.text.strip().splitlines()[-1:] or [""]
            print(f"{len(reports):6} {ending} {place} [{targets}]\n       {last[0][:300]}")
            print(f"       --seed {self._seed} --only {first.target} --case {first.number}")
        counts = ", ".join(f"{self._endings[key]} {name}" for key, name in ENDINGS.items())
        print(
            f"seed {self._seed}: {self._endings.total()} cases, "
            f"{self._endings['refused']} refused, {self._endings['accepted']} accepted, "
            f"{counts}, peak memory {self._peak:.0f} MB"
        )
        if self.failures:
            print(f"The failures are in {self._keep}.")

    def _save(self, report: Report) -> None:
        folder = self._keep / f"{report.target}-{self._seed}-{report.number}"
        folder.mkdir(parents=True, exist_ok=True)
        if report.folder is not None and report.folder.is_dir():
            shutil.copytree(report.folder, folder / "files", dirs_exist_ok=True)
        story = (
            f"--seed {self._seed} --only {report.target} --case {report.number}\n\n{report.text}\n"
        )
        (folder / "failure.txt").write_text(story, encoding="utf-8", errors="backslashreplace")
