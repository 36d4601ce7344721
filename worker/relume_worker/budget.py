"""Reject a bake that exceeds memory or disk before anything is computed."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

from relume.core.errors import DiskBudgetError, MemoryBudgetError
from relume.store.bake_protocol import Plan
from relume.store.disk_space import RESERVE_BYTES

REMEDY = "give fewer lights, a smaller size or fewer views"

MEMORY_FRACTION = 0.9  # the rest is for the server and the system

_GROUPS = Path("/sys/fs/cgroup")
_PROCESS_GROUPS = Path("/proc/self/cgroup")


def machine_bytes() -> int:
    """Total memory of the machine, or of the control group (container) of this process, in bytes."""
    try:
        machine = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (ValueError, OSError, AttributeError):  # not on every system
        machine = 4 << 30
    return min([machine, *(limit for limit, _ in _groups())])


def available_bytes() -> int:
    """Memory available now, of the system or within the control group (container), in bytes."""
    return min(
        [_system_available_bytes(), *(max(0, limit_bytes - used_bytes) for limit_bytes, used_bytes in _groups())]
    )


def _groups() -> list[tuple[int, int]]:
    """Memory limit and use of this process's control groups, version 2 and 1, in bytes."""
    limits = []
    for folder, limit_name, usage_name in _group_folders():
        try:
            limits.append((int((folder / limit_name).read_text()), int((folder / usage_name).read_text())))
        except (OSError, ValueError):  # no such file, or "max"
            continue
    return limits


def _group_folders() -> list[tuple[Path, str, str]]:
    """Folders of the control groups: in a container the root, otherwise the own group and all its parents."""
    folders = []
    try:
        lines = _PROCESS_GROUPS.read_text().splitlines()
    except OSError:  # not Linux
        return []
    for line in lines:
        number, controllers, path = line.split(":", 2)
        if number == "0":
            root, names = _GROUPS, ("memory.max", "memory.current")
        elif "memory" in controllers.split(","):
            root, names = _GROUPS / "memory", ("memory.limit_in_bytes", "memory.usage_in_bytes")
        else:
            continue
        group_folder = root / path.lstrip("/")
        folders += [
            (folder, *names)
            for folder in (group_folder, *group_folder.parents)
            if folder == root or root in folder.parents
        ]
    return folders


def _system_available_bytes() -> int:
    """Memory that processes can take without swapping, in bytes; total memory if the system does not report it."""
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    except OSError:  # not Linux
        pass
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def check_budget(plan: Plan, data_dir: Path, num_processes: int) -> None:
    """Reject a plan that needs more memory or disk space than is available.

    Args:
        plan: plan of the bake.
        data_dir: data directory on the disk for the store.
        num_processes: concurrent worker processes on this machine; 0 if they run elsewhere.
    Raises:
        MemoryBudgetError, DiskBudgetError: the plan exceeds it; the message has needed and available bytes, and
            remedies.
    """
    allowed_bytes = int(available_bytes() * MEMORY_FRACTION)
    needed_bytes = (plan.peak_bytes - plan.lone_bytes) * num_processes + plan.lone_bytes
    if num_processes > 0 and needed_bytes > allowed_bytes:
        label = f"the memory of this bake in {num_processes} process{'es' if num_processes > 1 else ''}"
        raise MemoryBudgetError(label, needed_bytes, allowed_bytes, f"{REMEDY}, or a scene with fewer triangles")
    free_disk_bytes, required_disk_bytes = (
        max(0, shutil.disk_usage(data_dir).free - RESERVE_BYTES),
        plan.planned_bytes + plan.scratch_bytes,
    )
    if required_disk_bytes > free_disk_bytes:
        raise DiskBudgetError(
            "the store of this bake on disk", required_disk_bytes, free_disk_bytes, f"free disk space, or {REMEDY}"
        )
