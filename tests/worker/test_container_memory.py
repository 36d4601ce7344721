"""Memory available to a process in a container, from control groups v1 and v2."""

from __future__ import annotations

from pathlib import Path

import pytest

from relume_server.settings import GIB, Settings
from relume_worker import budget


@pytest.fixture
def groups(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(budget, "_GROUPS", tmp_path / "cgroup")
    monkeypatch.setattr(budget, "_PROCESS_GROUPS", tmp_path / "own")
    monkeypatch.setattr("os.sysconf", lambda name: {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 64 * GIB // 4096}[name])
    return tmp_path


def write(folder: Path, **files: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name.replace("__", ".")).write_text(text)


def test_machine_without_control_groups_has_all_memory(groups: Path) -> None:
    assert budget.machine_bytes() == 64 * GIB
    write(groups, own="0::/\n1:cpu:/\n")
    write(groups / "cgroup", memory__max="max\n", memory__current="5")
    assert budget.machine_bytes() == 64 * GIB


@pytest.mark.parametrize(
    ("own", "folder", "limit", "used"),
    [
        ("0::/\n", "cgroup", "memory__max", "memory__current"),
        ("0::/docker/0123\n", "cgroup", "memory__max", "memory__current"),  # the group is the visible root
        ("0::/user/relume\n", "cgroup/user", "memory__max", "memory__current"),  # an ancestor has the limit
        ("4:cpu,memory:/docker/0123\n0::/\n", "cgroup/memory", "memory__limit_in_bytes", "memory__usage_in_bytes"),
        ("4:memory:/slice\n", "cgroup/memory/slice", "memory__limit_in_bytes", "memory__usage_in_bytes"),
    ],
)
def test_container_has_the_memory_of_its_control_group(
    groups: Path, own: str, folder: str, limit: str, used: str
) -> None:
    write(groups, own=own)
    write(groups / folder, **{limit: str(8 * GIB), used: str(7 * GIB)})
    assert budget.machine_bytes() == 8 * GIB
    assert budget.available_bytes() <= GIB
    settings = Settings()
    assert (settings.cache_bytes, settings.batch_bytes) == (2 * GIB, GIB)
    assert settings.import_bytes == 8 * GIB // 3
