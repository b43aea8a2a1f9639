"""Scenarios as tests: ``pytest -p planners.scenario.pytest_plugin FOLDER``.

Each ``scenario.toml`` below the folder is one test, named after the folder that it lies in.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from groundmap.errors import FileFormatError
from planners.scenario.case import FILE
from planners.scenario.outcome import Outcome
from planners.scenario.run import run_scenario


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> ScenarioFile | None:
    """Collect scenario files as test files.

    Parameters
    ----------
    file_path : Path
    parent : pytest.Collector
    """
    if file_path.name != FILE:
        return None
    return ScenarioFile.from_parent(parent, path=file_path)


class ScenarioFile(pytest.File):
    """A file of one scenario."""

    def collect(self) -> Iterator[ScenarioItem]:
        """Yield the test of the scenario."""
        yield ScenarioItem.from_parent(self, name=self.path.parent.name)


class ScenarioItem(pytest.Item):
    """A scenario that passes if all its bounds hold."""

    def runtest(self) -> None:
        """Run the scenario."""
        outcome = run_scenario(self.path)
        if outcome.passed is None:
            pytest.skip(outcome.skipped)
        if outcome.missed:
            raise BoundsMissedError(outcome)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], *args: Any) -> Any:
        """Return the missed bounds, or the error of the file.

        Parameters
        ----------
        excinfo : pytest.ExceptionInfo
        *args
            Passed to pytest's method.
        """
        if isinstance(excinfo.value, BoundsMissedError | FileFormatError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, *args)

    def reportinfo(self) -> tuple[Path, None, str]:
        """Return path, line and name of the test."""
        return self.path, None, self.name


class BoundsMissedError(AssertionError):
    """A scenario whose bounds do not all hold."""

    def __init__(self, outcome: Outcome) -> None:
        super().__init__("\n".join([f"{outcome.name}: {outcome.why}", *outcome.missed]))
