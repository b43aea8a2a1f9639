"""Check the wheel in a folder, and install it with the test tools in a separate venv."""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
import tomllib
import venv
import zipfile
from pathlib import Path

PYPROJECT = Path(__file__).parent.parent / "pyproject.toml"


def main(folder: Path, environment: Path) -> None:
    """Install the wheel of `folder` in `environment`, unless it is installed already."""
    (wheel,) = folder.glob("*.whl")
    check_top_level(wheel)
    third_party, content = digest(PYPROJECT), digest(wheel)
    stamp = environment / "installed.sha256"
    installed = stamp.read_text().split() if stamp.exists() else []
    if installed == [third_party, content]:
        print(f"{wheel.name} is installed in {environment}")
        return
    stamp.unlink(missing_ok=True)
    if installed[:1] != [third_party]:
        venv.create(environment, clear=True, with_pip=True)
        pip(environment, "install", f"{wheel}[test]")
    else:
        replace_package(environment, wheel)
    stamp.write_text(f"{third_party}\n{content}\n")
    print(f"Installed {wheel.name} in {environment}")


def check_top_level(wheel: Path) -> None:
    """Exit unless the wheel contains the two packages, its metadata, and nothing else."""
    project = tomllib.loads(PYPROJECT.read_text())["project"]
    expected = {"groundmap", "planners", f"{project['name']}-{project['version']}.dist-info"}
    with zipfile.ZipFile(wheel) as archive:
        names = {name.partition("/")[0] for name in archive.namelist()}
    if names != expected:
        sys.exit(f"{wheel.name}: expected {sorted(expected)} at the top, got {sorted(names)}")
    print(f"{wheel.name} contains {', '.join(sorted(names))}")


def replace_package(environment: Path, wheel: Path) -> None:
    """Replace an older wheel, and remove the compiled code that it left behind."""
    pip(environment, "uninstall", "--yes", "groundmap")
    for package in ("groundmap", "planners"):
        for remains in environment.glob(f"lib/python*/site-packages/{package}"):
            shutil.rmtree(remains)
    pip(environment, "install", "--no-deps", str(wheel))


def pip(environment: Path, command: str, *arguments: str) -> None:
    """Run pip in `environment`."""
    python = environment / "bin" / "python"
    subprocess.run([python, "-m", "pip", command, "--quiet", *arguments], check=True)


def digest(path: Path) -> str:
    """Return the SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
