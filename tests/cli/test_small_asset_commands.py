"""`relume list` and `relume delete` of environments, IES files and LUTs."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from environment_files import dusk, write_map
from ies_files import cosine_web, ies_text

from relume.assets.environments.environment_store import store_environment
from relume.assets.ies.ies_store import store_ies
from relume.assets.small_asset_store import SmallAssetRecord
from relume.luts.lut_store import store_lut
from relume_cli.main import main
from relume_worker import paths
from relume_worker.service import BakeService

Run = Callable[..., tuple[int, str, str]]
POLAR = np.linspace(0, 90, 10)
CUBE = "LUT_1D_SIZE 2\n0 0 0\n1 1 1\n"


@pytest.fixture
def assets(tmp_path: Path) -> dict[str, SmallAssetRecord]:
    """One asset of each kind in a data folder."""
    BakeService(tmp_path).close()
    ies, cube = tmp_path / "web.ies", tmp_path / "warm.cube"
    ies.write_text(ies_text(cosine_web(1, POLAR), POLAR))
    cube.write_text(CUBE)
    return {
        "environment": store_environment(
            paths.environments_path(tmp_path), write_map(tmp_path / "d.exr", dusk()), "Dusk"
        ),
        "ies": store_ies(paths.ies_path(tmp_path), ies, "Downlight"),
        "lut": store_lut(paths.luts_path(tmp_path), cube, "Warm"),
    }


@pytest.fixture
def run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Run:
    """Run a command on the folder and return its exit code, stdout and stderr."""

    def command(*words: str) -> tuple[int, str, str]:
        code = main([*words, "--data", str(tmp_path)])
        return code, *capsys.readouterr()

    return command


@pytest.mark.parametrize(
    ("kind", "plural", "field"),
    [("environment", "environments", "map"), ("ies", "ies", "profile"), ("lut", "luts", "lut")],
)
def test_assets_are_listed_and_deleted(kind: str, plural: str, field: str, assets: dict[str, Any], run: Run) -> None:
    record = assets[kind]
    assert run("list", plural)[1].splitlines()[-1].split() == [record.reference, record.name]
    document = json.loads(run("list", plural, "--json")[1].splitlines()[-1])
    assert {name: document[name] for name in ("id", field, "name", "warnings")} == {
        "id": record.id, field: record.reference, "name": record.name, "warnings": [],
    }  # fmt: skip
    assert run("delete", kind, record.name.lower(), "--yes")[1] == f"{record.id}\n"
    assert record.reference not in run("list", plural)[1]
    assert f"{record.id!r}; choose from none yet" in run("delete", kind, record.id, "--yes")[2]


def test_an_asset_is_deleted_by_its_name_in_looks(assets: dict[str, Any], run: Run) -> None:
    assert run("delete", "ies", assets["ies"].reference, "--yes")[:2] == (0, f"{assets['ies'].id}\n")
