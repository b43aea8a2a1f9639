"""The report: a self-contained HTML file with all outcomes and their pictures."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from os import PathLike
from typing import NamedTuple

from groundmap.files.archive import write_atomically
from planners.scenario.outcome import Figure, Outcome
from planners.scenario.summary import remarks, summary, verdict

TITLE = "Scenarios"
MARKS = {True: "✓", False: "✗", None: "○"}  # of verdicts and bounds, in addition to the colour
CLASSES = {True: "good", False: "bad", None: "idle"}
STYLE = """
:root { color-scheme: light dark; --ink: #1b1b1f; --soft: #5c5f66; --paper: #fff;
  --line: #d9dbe0; --band: #f4f5f7; --good: #1d6f42; --bad: #b3121d; --bad-band: #fdecec; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e6e9; --soft: #a2a6ae; --paper: #17181b;
  --line: #3a3d43; --band: #202226; --good: #6fcf97; --bad: #ff8a8a; --bad-band: #3a1d20; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem; max-width: 76rem; background: var(--paper);
  color: var(--ink); font: 1rem/1.5 system-ui, sans-serif; }
h1 { margin: 0.5rem 0 0; } h2 { margin: 0 0 0.25rem; font-size: 1.25rem; }
p { margin: 0.25rem 0 0.75rem; max-width: 48rem; }
a { color: inherit; } td.number { font-variant-numeric: tabular-nums; }
section { margin-top: 2rem; padding-top: 1rem; border-top: 1px solid var(--line); }
img { display: block; width: auto; max-width: 100%; height: auto; margin: 0.75rem 0;
  border-radius: 4px; background: #fff; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.9375rem; }
th, td { padding: 0.25rem 1rem 0.25rem 0.5rem; text-align: left; vertical-align: top;
  border-bottom: 1px solid var(--line); }
th { color: var(--soft); font-weight: 600; } td.number, th.number { text-align: right; }
td.number, td.verdict { white-space: nowrap; }
tr.bad { background: var(--bad-band); } tr.bad td:first-child { font-weight: 600; }
.headline { font-size: 1.125rem; } .verdict { font-weight: 600; }
.good .verdict { color: var(--good); } .bad .verdict { color: var(--bad); }
.idle { color: var(--soft); } ul { margin: 0; padding-left: 1.25rem; }
h2 .verdict { font-size: 1rem; margin-left: 0.5rem; }
"""


class Section(NamedTuple):
    """A section of the report about an experiment, with a picture and a table."""

    title: str
    text: str
    picture: bytes = b""  #: PNG
    rows: Sequence[Sequence[Figure]] = ()  #: rows of the table; the first has the column names


def write_report(
    path: str | PathLike[str], outcomes: Sequence[Outcome], *, sections: Sequence[Section] = ()
) -> None:
    """Write the outcomes as one HTML file, atomically.

    Parameters
    ----------
    path : path
    outcomes : sequence of Outcome
        In the order of display.
    sections : sequence of Section
        Sections after the outcomes.

    Raises
    ------
    OSError
        The folder does not exist or can't be written to.
    """
    text = _page(outcomes, sections)
    write_atomically(path, lambda stream: stream.write(text.encode()))


def format_figure(value: Figure) -> str:
    """Return a figure as text; numbers that are not integers have four digits.

    Examples
    --------
    >>> format_figure(0.123456), format_figure(52544), format_figure(None)
    ('0.1235', '52544', 'not measured')
    """
    if value is None:
        return "not measured"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _page(outcomes: Sequence[Outcome], sections: Sequence[Section]) -> str:
    head = (
        '<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        _tag("title", escape(f"{TITLE}: {summary(outcomes)}")),
        _tag("style", STYLE),
    )
    body = (
        _tag("h1", escape(TITLE)),
        _tag("p", escape(summary(outcomes)), kind="headline"),
        _overview(outcomes),
        *(_case(number, outcome) for number, outcome in enumerate(outcomes)),
        *(_section(section) for section in sections),
    )
    lines = ("<!DOCTYPE html>", '<html lang="en">', "<head>", *head, "</head>", "<body>", *body)
    return "\n".join((*lines, "</body>", "</html>", ""))


def _overview(outcomes: Sequence[Outcome]) -> str:
    """Return the table of all outcomes, with links to their sections."""
    rows = (
        _tag(
            "tr",
            _tag("td", f'<a href="#case-{number}">{escape(outcome.name)}</a>'),
            _tag("td", _verdict(outcome), kind="verdict"),
            _tag("td", f"{outcome.seconds:.1f}", kind="number"),
            _tag("td", "<br>".join(map(escape, remarks(outcome)))),
            kind=CLASSES[outcome.passed],
        )
        for number, outcome in enumerate(outcomes)
    )
    return _table(("case", "verdict", "seconds", "missed bounds"), rows, numbers=("seconds",))


def _case(number: int, outcome: Outcome) -> str:
    """Return the section of one outcome."""
    mark = _tag("span", _verdict(outcome), kind="verdict")
    parts = [
        _tag("h2", f"{escape(outcome.name)} {mark}", name=f"case-{number}"),
        _tag("p", escape(outcome.why)),
        _list(remarks(outcome)),
        _picture(outcome.picture, f"{outcome.name}: truth, map and difference"),
        _figures(outcome),
    ]
    return _tag("section", *parts, kind=CLASSES[outcome.passed])


def _figures(outcome: Outcome) -> str:
    """Return the table of figures and bounds, including bounds on missing figures."""
    names = [*outcome.figures, *(name for name in outcome.bounds if name not in outcome.figures)]
    if not names or outcome.passed is None:
        return ""
    return _table(
        ("figure", "value", "bound", "holds"),
        (_figure(name, outcome) for name in names),
        numbers=("value",),
    )


def _figure(name: str, outcome: Outcome) -> str:
    value, bound = outcome.figures.get(name), outcome.bounds.get(name)
    holds = None if bound is None else bound.holds(value)
    mark = "" if holds is None else f"{MARKS[holds]} {'yes' if holds else 'NO'}"
    return _tag(
        "tr",
        _tag("td", escape(name.replace("_", " "))),
        _tag("td", escape(format_figure(value)), kind="" if isinstance(value, str) else "number"),
        _tag("td", escape("" if bound is None else str(bound))),
        _tag("td", mark, kind="verdict"),
        kind="" if holds is None else CLASSES[holds],
    )


def _section(section: Section) -> str:
    head, *body = section.rows or ((),)
    rows = (_tag("tr", *(_tag("td", escape(format_figure(cell))) for cell in row)) for row in body)
    table = _table([format_figure(cell) for cell in head], rows) if section.rows else ""
    return _tag(
        "section",
        _tag("h2", escape(section.title)),
        _tag("p", escape(section.text)),
        _picture(section.picture, section.title),
        table,
    )


def _verdict(outcome: Outcome) -> str:
    return f"{MARKS[outcome.passed]} {verdict(outcome)}"


def _picture(png: bytes, description: str) -> str:
    if not png:
        return ""
    data = base64.b64encode(png).decode()
    return f'<img alt="{escape(description)}" src="data:image/png;base64,{data}">'


def _list(sentences: Sequence[str]) -> str:
    items = (_tag("li", escape(sentence)) for sentence in sentences)
    return _tag("ul", *items) if sentences else ""


def _table(names: Sequence[str], rows: Iterable[str], *, numbers: Sequence[str] = ()) -> str:
    """Return a table that scrolls horizontally on a narrow screen."""
    head = (_tag("th", escape(name), kind="number" if name in numbers else "") for name in names)
    table = _tag("table", _tag("thead", _tag("tr", *head)), _tag("tbody", *rows))
    return _tag("div", table, kind="wide")


def _tag(element: str, *content: str, kind: str = "", name: str = "") -> str:
    """Return an element with escaped HTML as content; `kind` is its class, `name` its id."""
    values = (("class", kind), ("id", name))
    attributes = (f' {key}="{escape(value)}"' for key, value in values if value)
    return f"<{element}{''.join(attributes)}>{''.join(content)}</{element}>"
