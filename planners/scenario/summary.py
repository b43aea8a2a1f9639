"""Verdicts, remarks and counts in words, as the printed table and the report show them."""

from __future__ import annotations

from collections.abc import Sequence

from planners.scenario.outcome import REASON, Outcome

VERDICTS = {True: "passed", False: "FAILED", None: "skipped"}


def verdict(outcome: Outcome) -> str:
    """Return the verdict in a word: passed, FAILED or skipped."""
    return VERDICTS[outcome.passed]


def remarks(outcome: Outcome) -> tuple[str, ...]:
    """Return a sentence for each missed bound, or the reason why the scenario was skipped."""
    return (*outcome.missed, *([outcome.skipped] if outcome.skipped else []))


def reasons(outcome: Outcome) -> list[str]:
    """Return why queries have no route: a sentence for each that the remarks do not contain."""
    remarked = "\n".join(remarks(outcome))
    return [
        f"{name.removesuffix(f'.{REASON}')}: {value}"
        for name, value in outcome.figures.items()
        if name.endswith(f".{REASON}") and str(value) not in remarked
    ]


def summary(outcomes: Sequence[Outcome]) -> str:
    """Return how many scenarios passed, failed and were skipped, and their total time."""
    verdicts = [verdict(outcome) for outcome in outcomes]
    counts = (f"{verdicts.count(word)} {word.lower()}" for word in VERDICTS.values())
    return f"{', '.join(counts)} in {sum(outcome.seconds for outcome in outcomes):.1f} s"
