"""Settings that every test shares."""

from __future__ import annotations

import sysconfig
from pathlib import Path

import hypothesis
import pytest

import groundmap
import planners

PACKAGES = (groundmap, planners)

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


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--installed",
        action="store_true",
        help="refuse to run unless both packages come from site-packages",
    )


def pytest_report_header() -> list[str]:
    return [f"{package.__name__} from {_home(package.__file__)}" for package in PACKAGES]


def pytest_configure(config: pytest.Config) -> None:
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
