"""The file of the extension: versions and hashes of the lock, and a manifest that lists them."""

from __future__ import annotations

import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from project_scripts import load_script

ROOT = Path(__file__).resolve().parents[2]
LOCK = """# made by make lock
anyio==4.1 \\
    --hash=sha256:aa \\
    --hash=sha256:bb
httpx==0.28 ; python_version >= '3.11' \\
    --hash=sha256:cc
"""


@pytest.fixture(scope="module")
def script() -> ModuleType:
    return load_script("build_blender_addon")


def test_requirements_have_the_hashes_of_the_lock(script: ModuleType) -> None:
    text = script.locked_requirements(LOCK, ["httpx"])
    assert text == "httpx==0.28 ; python_version >= '3.11' \\\n    --hash=sha256:cc\n\n"
    with pytest.raises(ValueError, match="the lock has no h11, idna"):
        script.locked_requirements(LOCK, ["httpx", "h11", "idna"])


def test_lock_has_all_packages(script: ModuleType) -> None:
    text = script.locked_requirements((ROOT / "requirements.lock").read_text(), script.PACKAGES)
    assert all(f"{name}==" in text for name in script.PACKAGES)


def test_manifest_lists_the_wheels(script: ModuleType) -> None:
    text = (ROOT / "blender" / "relume_blender" / "blender_manifest.toml").read_text()
    manifest = tomllib.loads(script.make_manifest(text, "1.2.3", ["a-1-py3-none-any.whl"]))
    assert manifest["version"] == "1.2.3"
    assert manifest["wheels"] == ["./wheels/a-1-py3-none-any.whl"]
    assert manifest["permissions"].keys() == {"network", "files"}
    assert manifest["id"] == "relume"
