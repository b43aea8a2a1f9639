"""Settings that every test shares."""

from __future__ import annotations

import math
import signal
import sysconfig
from itertools import count
from pathlib import Path
from typing import Any

import hypothesis
import pytest

import groundmap
import planners
from planners.search.base import Clock, SearchSettings

DEFAULT_LIMIT = SearchSettings().time_limit
TICK = 1e-4  # [s] that pass at each look at the clock of `ticking`
PACKAGES = (groundmap, planners)

collect_ignore = ["corpus"]  # damaged files, which test_fuzz.py reads; scenarios are among them

# The same examples every time, and no clock: kernels compile during some first example.
hypothesis.settings.register_profile(
    "ci",
    deadline=None,
    derandomize=True,
    print_blob=True,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
# New examples on every run, and more of them: what `make fuzz` looks for.
hypothesis.settings.register_profile(
    "explore",
    hypothesis.settings.get_profile("ci"),
    derandomize=False,
    max_examples=500,
)
hypothesis.settings.load_profile("ci")


@pytest.fixture(autouse=True)
def no_default_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no search end by the default time limit: on a slow machine, it may need longer."""
    begin = Clock.__init__

    def unlimited(self: Clock, planner: str, time_limit: float | None, *rest: Any) -> None:
        begin(self, planner, None if time_limit == DEFAULT_LIMIT else time_limit, *rest)

    monkeypatch.setattr(Clock, "__init__", unlimited)


@pytest.fixture
def ticking(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let time pass only where a search looks at the clock."""
    looks = count()
    for module in ("search.base", "route.solve", "planning"):
        monkeypatch.setattr(f"planners.{module}.now", lambda: TICK * next(looks))
    monkeypatch.setattr(
        "planners.sampling.ompl_states.POLL_INTERVAL", math.inf
    )  # looks by calls, not by time


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--installed",
        action="store_true",
        help="refuse to run unless both packages come from site-packages",
    )


def pytest_report_header() -> list[str]:
    return [f"{package.__name__} from {_home(package.__file__)}" for package in PACKAGES]


def pytest_configure(config: pytest.Config) -> None:
    # A shell's background job inherits that Ctrl-C is ignored; tests of interrupts send it.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if not config.getoption("--installed"):
        return
    site_packages = Path(sysconfig.get_path("purelib")).resolve()
    for package in PACKAGES:
        if _home(package.__file__).parent != site_packages:
            raise pytest.UsageError(
                f"{package.__name__}: expected it in {site_packages}, got {package.__file__}."
            )


def _home(file: str | None) -> Path:
    assert file is not None
    return Path(file).resolve().parent
