"""The table of outcomes that people read on stdout, and the words that the report shares."""

from __future__ import annotations

from collections.abc import Sequence

from planners.scenario.outcome import REASON, Outcome

VERDICTS = {True: "passed", False: "FAILED", None: "skipped"}


def print_table(outcomes: Sequence[Outcome]) -> None:
    """Print a line for each outcome, and how many there are of each.

    Below the line is what the outcome missed, and why there are no routes where there are none.

    Examples
    --------
    >>> print_table([
    ...     Outcome(
    ...         "room",
    ...         "a room",
    ...         True,
    ...         figures={"through.reason": "no route: the goal is enclosed."},
    ...         seconds=1.26,
    ...     ),
    ...     Outcome("glass door", "glass", False, missed=("false_free: 0.2, not ≤ 0.01",)),
    ...     Outcome("drive", "a log", None, skipped="no such file"),
    ... ])
    room        passed      1.3 s
        through: no route: the goal is enclosed.
    glass door  FAILED      0.0 s
        false_free: 0.2, not ≤ 0.01
    drive       skipped     0.0 s
        no such file
    1 passed, 1 failed, 1 skipped in 1.3 s
    """
    width = max((len(outcome.name) for outcome in outcomes), default=0)
    for outcome in outcomes:
        print(f"{outcome.name:<{width}}  {verdict(outcome):<7}  {outcome.seconds:6.1f} s")
        for sentence in (*remarks(outcome), *reasons(outcome)):
            print(f"    {sentence}")
    print(summary(outcomes))


def verdict(outcome: Outcome) -> str:
    """Return the word for it: passed, FAILED or skipped."""
    return VERDICTS[outcome.passed]


def remarks(outcome: Outcome) -> tuple[str, ...]:
    """Return what there is to say: a sentence for each missed bound, or why it was skipped."""
    return (*outcome.missed, *([outcome.skipped] if outcome.skipped else []))


def reasons(outcome: Outcome) -> list[str]:
    """Return why queries have no route: a sentence for each that the remarks don't hold."""
    said = "\n".join(remarks(outcome))
    return [
        f"{name.removesuffix(f'.{REASON}')}: {value}"
        for name, value in outcome.figures.items()
        if name.endswith(f".{REASON}") and str(value) not in said
    ]


def summary(outcomes: Sequence[Outcome]) -> str:
    """Return how many passed, failed and were skipped, and how long they took in all."""
    verdicts = [verdict(outcome) for outcome in outcomes]
    counts = (f"{verdicts.count(word)} {word.lower()}" for word in VERDICTS.values())
    return f"{', '.join(counts)} in {sum(outcome.seconds for outcome in outcomes):.1f} s"
