"""Build the wheel and the source distribution in dist/, and check what they contain: `make wheel`, `make release`.

The editor must be built. With --release, the checkout must be clean, and its version named by pyproject.toml and
CHANGELOG.md.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Sequence
from contextlib import chdir
from pathlib import Path, PurePosixPath

import hatchling.build

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = {"relume", "relume_server", "relume_worker", "relume_cli", "relume_client", "relume_bench"}
EDITOR = "relume_server/editor"
REQUIRED = (
    f"{EDITOR}/index.html",
    "relume/look/library/merl_fits.json",
    "relume/output/material_previews/balls.webp",
    "relume_worker/database/revisions/script.py.mako",
)
MAX_BYTES = 8 * 1024**2
"""Of a distribution, compressed: more is data that nobody meant to distribute."""
_UNWANTED = re.compile(r"(^|/)(tests?|shared|data|node_modules|__pycache__|\.venv)/|\.(pyc|log|db|exr|hdr|zarr)$")


def wheel_faults(wheel: Path) -> list[str]:
    """Faults of a wheel's contents, one sentence each: packages, editor, files that do not belong in it."""
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        page = archive.read(REQUIRED[0]).decode() if REQUIRED[0] in names else ""
    tops = {PurePosixPath(name).parts[0] for name in names if ".dist-info/" not in name}
    missing_files = [name for name in (*REQUIRED, *_assets_of(page)) if name not in names]
    faults = [f"{name} is missing" for name in missing_files]
    faults += [f"the package {name} is missing" for name in sorted(PACKAGES - tops)]
    faults += [f"{name} would be installed beside other programs' packages" for name in sorted(tops - PACKAGES)]
    return faults + _common_faults(wheel, names)


def sdist_faults(sdist: Path) -> list[str]:
    """Faults of a source distribution's contents, one sentence each."""
    with tarfile.open(sdist) as archive:
        names = [name.partition("/")[2] for name in archive.getnames()]
    required = (
        "pyproject.toml",
        "hatch_build.py",
        "LICENSE",
        "client_web/dist/index.html",
        "client_web/src/app/main.tsx",
    )
    return [f"{name} is missing" for name in required if name not in names] + _common_faults(sdist, names)


def _assets_of(page: str) -> list[str]:
    """Files of the wheel that the editor's page loads, by addresses relative to it."""
    return [f"{EDITOR}/{path}" for path in re.findall(r'(?:src|href)="\./([^"]+)"', page)] or [f"{EDITOR}/assets/…"]


def _common_faults(path: Path, names: Sequence[str]) -> list[str]:
    faults = [f"{name} does not belong in it" for name in names if _UNWANTED.search(name)]
    size = path.stat().st_size
    return faults + ([f"it has {size / 1e6:.1f} MB, more than {MAX_BYTES / 1e6:.1f}"] if size > MAX_BYTES else [])


def release_faults(root: Path, version: str) -> list[str]:
    """Reasons why a checkout is not to be released as this version, one sentence each."""
    named = tomllib.loads((root / "pyproject.toml").read_text())["project"]["version"]
    command = ["git", "status", "--porcelain"]
    status = subprocess.run(command, cwd=root, check=True, capture_output=True, text=True).stdout  # noqa: S603
    faults = [] if version == named else [f"pyproject.toml has the version {named}"]
    if not re.search(rf"^## {re.escape(version)}$", (root / "CHANGELOG.md").read_text(), re.MULTILINE):
        faults.append(f"CHANGELOG.md has no section {version}")
    return faults + (["the checkout has changes that are not committed"] if status.strip() else [])


def build_wheel(root: Path, output: Path) -> Path:
    """Build a checkout's wheel. Raises FileNotFoundError if the editor is not built."""
    with chdir(root):  # the hooks of PEP 517 build the current folder
        return output / hatchling.build.build_wheel(str(output))


def build_sdist(root: Path, output: Path) -> Path:
    """Build a checkout's source distribution. Raises FileNotFoundError if the editor is not built."""
    with chdir(root):
        return output / hatchling.build.build_sdist(str(output))


def main() -> None:
    """Build, check, and print the two paths; exit with all faults in words."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--release", metavar="VERSION", help="refuse what is not to be released as this version")
    version = parser.parse_args().release
    if version is not None and (faults := release_faults(ROOT, version)):
        sys.exit(f"release: this is not {version}: {'; '.join(faults)}")
    try:
        wheel, sdist = build_wheel(ROOT, ROOT / "dist"), build_sdist(ROOT, ROOT / "dist")
    except FileNotFoundError as error:
        sys.exit(f"release: {error}")
    faults = [f"{wheel.name}: {fault}" for fault in wheel_faults(wheel)]
    faults += [f"{sdist.name}: {fault}" for fault in sdist_faults(sdist)]
    if faults:
        sys.exit("release: " + "; ".join(faults))
    sys.stdout.write(f"{wheel}\n{sdist}\n")


if __name__ == "__main__":
    main()
