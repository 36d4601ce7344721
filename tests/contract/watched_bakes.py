"""A record of a bake's tasks beside its store."""

from pathlib import Path
from typing import NamedTuple

from relume.store.bake_protocol import Task


class Done(NamedTuple):
    """A task, the arrays that it wrote, and its number of traced rays."""

    task: Task
    paths: tuple[str, ...]
    num_rays: int


class Bake(NamedTuple):
    """A store and its tasks in order."""

    store: Path
    done: list[Done]
