"""A wheel holds the packages and the built editor, and nothing else; a release is clean and named."""

from __future__ import annotations

import shutil
import subprocess
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
from project_scripts import load_script

ROOT = Path(__file__).parents[2]
PAGE = '<script src="./assets/index-abc.js"></script>'


@pytest.fixture(scope="module")
def distributions() -> ModuleType:
    return load_script("build_distributions")


@pytest.fixture(scope="module")
def built(distributions: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    if not (ROOT / "client_web" / "dist" / "index.html").is_file():
        pytest.skip("the editor is not built here (make setup builds it)")
    folder = tmp_path_factory.mktemp("dist")
    return distributions.build_wheel(ROOT, folder), distributions.build_sdist(ROOT, folder)


def test_distributions_of_this_checkout_are_complete_and_clean(
    distributions: ModuleType, built: tuple[Path, Path]
) -> None:
    wheel, sdist = built
    assert distributions.wheel_faults(wheel) == []
    assert distributions.sdist_faults(sdist) == []


def test_wheel_can_be_built_from_the_source_distribution(
    distributions: ModuleType, built: tuple[Path, Path], tmp_path: Path
) -> None:
    wheel, sdist = built
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path, filter="data")
    (folder,) = tmp_path.iterdir()
    again = distributions.build_wheel(folder, tmp_path / "dist")
    names = [set(zipfile.ZipFile(each).namelist()) for each in (wheel, again)]
    assert names[0] == names[1]


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda files: files.pop("relume_server/editor/assets/index-abc.js"), "index-abc.js is missing"),
        (lambda files: files.pop("relume_server/editor/index.html"), "index.html is missing"),
        (lambda files: files.pop("relume_cli/__init__.py"), "the package relume_cli is missing"),
        (lambda files: files.update({"server/__init__.py": ""}), "server would be installed beside"),
        (lambda files: files.update({"relume/tests/test_a.py": ""}), "relume/tests/test_a.py does not belong"),
        (lambda files: files.update({"relume/data/a.exr": ""}), "relume/data/a.exr does not belong"),
    ],
)
def test_faults_of_a_wheel_are_named(
    distributions: ModuleType, tmp_path: Path, change: Callable[[dict[str, str]], object], fault: str
) -> None:
    files = dict.fromkeys((*distributions.REQUIRED, "relume_server/editor/assets/index-abc.js"), PAGE)
    files |= {f"{package}/__init__.py": "" for package in distributions.PACKAGES}
    files["relume-0.1.0.dist-info/METADATA"] = ""
    assert distributions.wheel_faults(_wheel(tmp_path / "whole.whl", files)) == []
    change(files)
    faults = distributions.wheel_faults(_wheel(tmp_path / "faulty.whl", files))
    assert any(fault in each for each in faults), faults


def _wheel(path: Path, files: dict[str, str]) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return path


def test_without_the_editor_nothing_is_built_and_the_way_is_shown(distributions: ModuleType, tmp_path: Path) -> None:
    for name in ("pyproject.toml", "hatch_build.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, tmp_path)
    with pytest.raises(FileNotFoundError, match="npm ci && npm run build"):
        distributions.build_wheel(tmp_path, tmp_path / "dist")


class TestRelease:
    @pytest.fixture
    def checkout(self, tmp_path: Path) -> Path:
        (tmp_path / "pyproject.toml").write_text('[project]\nversion = "1.2.0"\n')
        (tmp_path / "CHANGELOG.md").write_text("# Changelog\n\n## 1.2.0\n\n## 1.1.0\n")
        identity = ("-c", "user.name=Ann", "-c", "user.email=ann@example.org")
        for command in (("init", "-q"), ("add", "-A"), (*identity, "commit", "-qm", "all")):
            subprocess.run(["git", *command], cwd=tmp_path, check=True)
        return tmp_path

    def test_clean_and_named_checkout_is_released(self, distributions: ModuleType, checkout: Path) -> None:
        assert distributions.release_faults(checkout, "1.2.0") == []

    def test_all_faults_are_named(self, distributions: ModuleType, checkout: Path) -> None:
        (checkout / "new.py").write_text("")
        assert distributions.release_faults(checkout, "1.3.0") == [
            "pyproject.toml has the version 1.2.0",
            "CHANGELOG.md has no section 1.3.0",
            "the checkout has changes that are not committed",
        ]
