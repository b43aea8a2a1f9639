"""The HTML report, parsed as a browser would."""

from __future__ import annotations

import base64
import io
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from groundmap.draw import figure_png
from planners.scenario.outcome import Bound, Outcome
from planners.scenario.report import Section, format_figure, write_report

VOID = {"meta", "img", "br"}
PICTURE = figure_png(Figure(figsize=(1.0, 0.5)), dpi=20)
OUTCOMES = [
    Outcome(
        "room",
        "A room with four walls.",
        True,
        figures={"recall": 0.987654, "cells": 52544, "route": None},
        bounds={"recall": Bound(min=0.97)},
        picture=PICTURE,
        seconds=1.25,
    ),
    Outcome(
        "glass & <b>steel</b>",
        "Sight passes; <script>alert('no')</script> does not.",
        False,
        figures={"false_free": 0.25},
        bounds={"false_free": Bound(max=0.01), "clearance": Bound(min=0.3)},
        missed=("false_free: 0.25, expected ≤ 0.01", "clearance was not measured"),
        picture=PICTURE,
        seconds=2.0,
    ),
    Outcome("drive", "A log.", None, skipped="The log is not here."),
]
SECTION = Section("Density", "Fewer & fewer.", PICTURE, [("features", "recall"), (50, 0.123456)])


class Page(HTMLParser):
    """What a page holds; fails on tags that are not closed, or in the wrong order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.cells: list[list[str]] = []
        self.text: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.cells.append([])
        if tag in {"td", "th"}:
            self.cells[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] != "style":
            self.text.append(data)
        if "td" in self.open or "th" in self.open:
            self.cells[-1][-1] += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture
def html(tmp_path: Path) -> str:
    path = tmp_path / "report.html"
    write_report(path, OUTCOMES, sections=[SECTION])
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    return path.read_text(encoding="utf-8")


def test_every_tag_is_closed(html: str) -> None:
    assert html.startswith("<!DOCTYPE html>")
    assert {tag for tag, _ in Page(html).tags} >= {"html", "head", "body", "table", "section"}


def test_names_purposes_and_remarks_are_on_the_page(html: str) -> None:
    text = "".join(Page(html).text)
    for outcome in OUTCOMES:
        for part in (outcome.name, outcome.why, outcome.skipped, *outcome.missed):
            assert part in text
    assert SECTION.title in text
    assert SECTION.text in text


def test_the_headline_has_the_counts(html: str) -> None:
    assert "1 passed, 1 failed, 1 skipped in 3.2 s" in Page(html).text


def test_texts_of_scenarios_are_escaped(html: str) -> None:
    assert Page(html).all("script") == []
    assert Page(html).all("b") == []
    assert "&lt;script&gt;" in html


def test_pictures_are_pngs_inside_the_page(html: str) -> None:
    pictures = Page(html).all("img")
    assert len(pictures) == 3
    for picture in pictures:
        kind, _, data = (picture["src"] or "").partition(",")
        assert kind == "data:image/png;base64"
        assert imread(io.BytesIO(base64.b64decode(data, validate=True))).shape[:2] == (10, 20)
        assert picture["alt"]


def test_the_page_needs_no_other_file(html: str) -> None:
    assert not re.search(r"https?:|url\(|@import", html)
    page = Page(html)
    assert page.all("link") == []
    assert all((image["src"] or "").startswith("data:") for image in page.all("img"))


def test_each_name_links_to_its_case(html: str) -> None:
    page = Page(html)
    places = {attributes.get("id") for _, attributes in page.tags}
    links = [link["href"] or "" for link in page.all("a")]
    assert len(set(links)) == len(OUTCOMES)
    assert {link.removeprefix("#") for link in links} <= places


def test_the_table_of_cases_has_verdicts_in_words(html: str) -> None:
    rows = Page(html).cells[: len(OUTCOMES) + 1]
    assert rows[0] == ["case", "verdict", "seconds", "missed bounds"]
    assert [row[:3] for row in rows[1:]] == [
        ["room", "✓ passed", "1.2"],
        ["glass & <b>steel</b>", "✗ FAILED", "2.0"],
        ["drive", "○ skipped", "0.0"],
    ]
    assert "expected ≤ 0.01" in rows[2][3]


def test_each_figure_has_its_bound_and_whether_it_holds(html: str) -> None:
    rows = Page(html).cells
    assert ["recall", "0.9877", "≥ 0.97", "✓ yes"] in rows
    assert ["cells", "52544", "", ""] in rows
    assert ["route", "not measured", "", ""] in rows
    assert ["false free", "0.25", "≤ 0.01", "✗ NO"] in rows
    assert ["clearance", "not measured", "≥ 0.3", "✗ NO"] in rows


def test_a_section_has_its_table(html: str) -> None:
    rows = Page(html).cells
    assert rows[-2:] == [["features", "recall"], ["50", "0.1235"]]


def test_the_page_adapts_to_phones_and_dark_mode(html: str) -> None:
    assert "width=device-width" in html
    assert "prefers-color-scheme: dark" in html
    assert "max-width: 100%" in html


def test_a_report_without_outcomes_is_written(tmp_path: Path) -> None:
    write_report(tmp_path / "report.html", [], sections=[Section("Alone", "No picture, no table.")])
    page = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert page.all("img") == []
    assert "0 passed, 0 failed, 0 skipped in 0.0 s" in page.text


def test_a_missing_folder_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No such file or directory"):
        write_report(tmp_path / "nowhere" / "report.html", OUTCOMES)


@pytest.mark.parametrize(
    ("value", "text"),
    [(1 / 3, "0.3333"), (1234567, "1234567"), ("x", "x"), (None, "not measured"), (np.nan, "nan")],
)
def test_numbers_have_four_digits(value: float | str | None, text: str) -> None:
    assert format_figure(value) == text
