"""What the tests keep of a bake beside its store."""

from pathlib import Path
from typing import NamedTuple

from relume.store.bake_protocol import Task


class Done(NamedTuple):
    """A task, the arrays that it wrote into, and the rays that it says it traced."""

    task: Task
    paths: tuple[str, ...]
    num_rays: int


class Bake(NamedTuple):
    """A store, and what its tasks did in their order."""

    store: Path
    done: list[Done]
