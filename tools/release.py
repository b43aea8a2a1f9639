"""Make a release: set the version, date the changelog, commit, tag. Pushes nothing."""

from __future__ import annotations

import argparse
import datetime
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
UNRELEASED = "## [Unreleased]\n"
#: Files that state the version, each with the line that does.
VERSIONED = {
    "pyproject.toml": r'^version = "(.*)"$',
    "CITATION.cff": r"^version: (.*)$",
}


def main() -> None:
    """Release the version named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("version", help="such as 0.2.0")
    version = parser.parse_args().version
    if not re.fullmatch(r"\d+\.\d+\.\d+", version):
        sys.exit(f"version: expected MAJOR.MINOR.PATCH, got {version!r}.")
    if git("status", "--porcelain"):
        sys.exit("Expected a clean work tree. Commit or stash the changes first.")
    if f"v{version}" in git("tag").split():
        sys.exit(f"version: expected a new one, got {version}, which is tagged.")
    today = datetime.date.today().isoformat()
    texts = {name: with_version(read(name), name, version) for name in VERSIONED}
    texts["CITATION.cff"] = re.sub(
        r"(?m)^date-released: .*$", f"date-released: {today}", texts["CITATION.cff"]
    )
    texts["CHANGELOG.md"] = with_section(read("CHANGELOG.md"), version, today)
    for name, text in texts.items():
        (ROOT / name).write_text(text, encoding="utf-8")
    git("commit", "--quiet", "--message", f"Release {version}", "--", *texts)
    git("tag", "--annotate", f"v{version}", "--message", f"groundmap {version}")
    print(f"Committed and tagged v{version}.")
    print("To publish: git push --follow-tags, then python -m build.")


def with_version(text: str, name: str, version: str) -> str:
    """Return a file's text with another version in it.

    Parameters
    ----------
    text : str
    name : str
        The file's name, one of `VERSIONED`.
    version : str
    """
    pattern = re.compile(VERSIONED[name], re.MULTILINE)
    match = pattern.search(text)
    if match is None:
        sys.exit(f"{name}: expected a line {VERSIONED[name]}, got none.")
    return text[: match.start(1)] + version + text[match.end(1) :]


def with_section(text: str, version: str, date: str) -> str:
    """Return the changelog with what is unreleased under a version.

    Parameters
    ----------
    text : str
    version : str
    date : str
        In ISO 8601.
    """
    before, found, after = text.partition(UNRELEASED)
    if not found or not after.partition("\n## ")[0].strip():
        sys.exit(f"CHANGELOG.md: expected entries below {UNRELEASED.strip()!r}, got none.")
    return f"{before}{UNRELEASED}\n## [{version}] - {date}\n{after}"


def read(name: str) -> str:
    """Return the text of a file of the project."""
    return (ROOT / name).read_text(encoding="utf-8")


def git(*arguments: str) -> str:
    """Return what git prints."""
    run = subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True)
    return run.stdout


if __name__ == "__main__":
    main()
