"""Build the Blender add-on, dist/relume-blender-VERSION.zip: `make blender-addon`.

It contains the wheels of relume_client and of what that imports, so that it installs without network. The packages
have the versions and hashes of requirements.lock; all are pure Python, so that one file serves every platform.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from collections.abc import Sequence
from contextlib import chdir
from pathlib import Path

import hatchling.build

ROOT = Path(__file__).resolve().parents[1]
ADDON = ROOT / "blender" / "relume_blender"
PACKAGES = ("anyio", "certifi", "h11", "httpcore", "httpx", "idna", "typing-extensions", "websockets")
"""Of relume_client without images; Blender has NumPy."""
_DATE = (2020, 1, 1, 0, 0, 0)
_CLIENT_PROJECT = """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"

[project]
name = "relume_client"
version = "{version}"
requires-python = ">=3.11"
license = "MIT"

[tool.hatch.build.targets.wheel]
packages = ["relume_client"]
exclude = ["relume_client/widget.*"]
"""


def locked_requirements(lock: str, packages: Sequence[str]) -> str:
    """The entries of packages in a lock file, with their hashes. Raises ValueError if one is missing."""
    named = {block.partition("==")[0]: block for block in re.split(r"\n(?=\S)", lock)}
    if missing := [name for name in packages if name not in named]:
        raise ValueError(f"the lock has no {', '.join(missing)}")
    return "\n".join(named[name] for name in packages) + "\n"


def download_wheels(folder: Path) -> None:
    """Download the wheels of the lock; pip refuses other hashes."""
    requirements = folder / "requirements.txt"
    requirements.write_text(locked_requirements((ROOT / "requirements.lock").read_text(), PACKAGES))
    pure = ["--only-binary=:all:", "--platform=any", "--implementation=py", "--abi=none", "--python-version=3.11"]
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--require-hashes", *pure]
    subprocess.run([*command, "-r", str(requirements), "-d", str(folder)], check=True)  # noqa: S603
    requirements.unlink()


def build_client_wheel(folder: Path, version: str) -> None:
    """Build the wheel of relume_client alone."""
    with tempfile.TemporaryDirectory() as project:
        shutil.copytree(
            ROOT / "client" / "relume_client",
            Path(project) / "relume_client",
            ignore=shutil.ignore_patterns("__pycache__"),
        )
        (Path(project) / "pyproject.toml").write_text(_CLIENT_PROJECT.format(version=version))
        with chdir(project):
            hatchling.build.build_wheel(str(folder))


def make_manifest(text: str, version: str, wheels: Sequence[str]) -> str:
    """The manifest with the version and the wheels. text: that of the checkout."""
    head, _, tail = text.partition("\n[")
    head = re.sub(r'^version = ".*"$', f'version = "{version}"', head, flags=re.MULTILINE)
    listed = "".join(f'  "./wheels/{name}",\n' for name in wheels)
    return f"{head.rstrip()}\nwheels = [\n{listed}]\n\n[{tail}"


def build_addon(output: Path) -> Path:
    """Build the file; returns its path."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    target = output / f"relume-blender-{version}.zip"
    output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        download_wheels(folder)
        build_client_wheel(folder, version)
        wheels = sorted(path.name for path in folder.glob("*.whl"))
        manifest = make_manifest((ADDON / "blender_manifest.toml").read_text(), version, wheels)
        with zipfile.ZipFile(target, "w") as archive:
            _write(archive, "blender_manifest.toml", manifest.encode())
            _write(archive, "LICENSE", (ROOT / "LICENSE").read_bytes())
            for path in sorted(ADDON.glob("*.py")):
                _write(archive, path.name, path.read_bytes())
            for wheel in wheels:
                _write(archive, f"wheels/{wheel}", (folder / wheel).read_bytes())
    return target


def _write(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    archive.writestr(zipfile.ZipInfo(name, _DATE), content, zipfile.ZIP_DEFLATED)


if __name__ == "__main__":
    sys.stdout.write(f"{build_addon(ROOT / 'dist')}\n")
