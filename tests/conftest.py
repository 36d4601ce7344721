"""Shared by all tests: paths of real files, helper modules, and the distribution of tests to processes."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import shape_checks  # noqa: F401 - before relume: it checks what is imported from then on

# isort: split
import pytest
from hypothesis import HealthCheck, settings
from postgres import Cluster
from shared_bakes import baked, corner, gathered, transfer
from xdist.scheduler import LoadScopeScheduling

__all__ = ["baked", "corner", "gathered", "transfer"]  # fixtures

os.environ.setdefault("RELUME_BATCH_NICE", "0")  # tests that run in parallel would wait too long for renders
os.environ.setdefault("RELUME_PREWARM", "false")  # no process after each bake
os.environ.setdefault("RELUME_PRELOAD_IMPORTER", "false")  # nor one of each server, before it imports anything

# examples are deterministic and have no deadline: machines differ in speed and load
settings.register_profile("relume", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("relume")

# folders whose tests share expensive fixtures: a server and a browser, a BTF, a measured material, bakes of all methods
TOGETHER = ("gestures", "journeys", "btf", "contract", "measured")
FIRST = (*TOGETHER, "worker")  # worker tests are long: they wait for processes and databases


class _FolderScheduling(LoadScopeScheduling):
    """Scheduler that runs the tests of a file, or of a folder in `TOGETHER`, in one process."""

    def _split_scope(self, nodeid: str) -> str:
        path = Path(nodeid.partition("::")[0])
        return path.parent.name if path.parent.name in TOGETHER else str(path)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> _FolderScheduling:
    """Called by xdist, whose own groups, made by marks, do not work with this pytest."""
    return _FolderScheduling(config, log)


def pytest_xdist_auto_num_workers() -> int:
    """Return two more processes than processors: tests of servers and browsers wait half of the time."""
    return (os.cpu_count() or 1) + 2


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Start the longest tests first, so that no process is left with one of them at the end."""
    order = {folder: position for position, folder in enumerate(FIRST)}
    items.sort(key=lambda item: order.get(item.path.parent.name, len(FIRST)))


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real scenes and environments; tests that need it are skipped without it."""
    data_folder = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("RELUME_SHARED_DATA", data_folder))
    if not folder.is_dir():
        pytest.skip("there is no folder of shared data; RELUME_SHARED_DATA names it")
    return folder


@pytest.fixture(scope="session")
def postgresql() -> Iterator[Cluster]:
    """A PostgreSQL server for all tests of this process; skipped if it is not installed."""
    cluster = Cluster()
    yield cluster
    cluster.remove()


@pytest.fixture(params=["sqlite", "postgresql"])
def ledger_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """URL of an empty database of either kind."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'relume.db'}"
    cluster: Cluster = request.getfixturevalue("postgresql")
    return cluster.new_database()
