"""What all tests share: where real files lie, helper modules beside this file, and which tests stay in one process."""

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

os.environ.setdefault("RELUME_BATCH_NICE", "0")  # tests beside which others run would wait for ever for renders
os.environ.setdefault("RELUME_PREWARM", "false")  # nor should each bake be followed by a process

# examples are drawn alike each time, and take as long as they take: machines differ, and others work on them
settings.register_profile("relume", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("relume")

# folders whose tests share what is dear: a server and a browser, a BTF, a measured material, a bake by every method
TOGETHER = ("gestures", "journeys", "btf", "contract", "measured")
FIRST = (*TOGETHER, "worker")  # files of the last are long, and wait for processes and databases


class _Sharing(LoadScopeScheduling):
    """Where tests are shared out to processes, those of a file, or of a folder in `TOGETHER`, go to the same one."""

    def _split_scope(self, nodeid: str) -> str:
        path = Path(nodeid.partition("::")[0])
        return path.parent.name if path.parent.name in TOGETHER else str(path)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> _Sharing:
    """Called by xdist; its own groups, which are marks, are lost on the way with this pytest."""
    return _Sharing(config, log)


def pytest_xdist_auto_num_workers() -> int:
    """Two processes more than there are processors: tests of servers and browsers wait as long as they compute."""
    return (os.cpu_count() or 1) + 2


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What takes longest begins, so that no process is left alone with it at the end."""
    order = {folder: position for position, folder in enumerate(FIRST)}
    items.sort(key=lambda item: order.get(item.path.parent.name, len(FIRST)))


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real scenes and environments; tests that need it skip where there is none."""
    data_folder = Path(__file__).parents[2] / "shared" / "data"
    folder = Path(os.environ.get("RELUME_SHARED_DATA", data_folder))
    if not folder.is_dir():
        pytest.skip("there is no folder of shared data; RELUME_SHARED_DATA names it")
    return folder


@pytest.fixture(scope="session")
def postgresql() -> Iterator[Cluster]:
    """A PostgreSQL for all tests of this process; skips where it is not installed."""
    cluster = Cluster()
    yield cluster
    cluster.remove()


@pytest.fixture(params=["sqlite", "postgresql"])
def ledger_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Where a ledger may be: an empty database of either kind."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'relume.db'}"
    cluster: Cluster = request.getfixturevalue("postgresql")
    return cluster.new_database()
