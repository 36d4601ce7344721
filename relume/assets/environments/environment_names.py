"""Environment maps of looks: "env:<id>" is imported, other names are built in."""

from __future__ import annotations

from relume.assets.environments.built_in import BUILT_IN, load_built_in
from relume.assets.environments.environment import Environment
from relume.assets.environments.environment_store import STORE, load_imported


def environment_exists(name: str) -> bool:
    """True if a look's `map` refers to an available environment."""
    return name in BUILT_IN or STORE.exists(name)


def environment_names() -> list[str]:
    """Return the names that a look's `map` can have."""
    return [*BUILT_IN, *STORE.list_names()]


def load_environment(name: str) -> Environment:
    """Load the environment of a look's `map`.

    Raises:
        NotFoundError: it does not exist. SceneError: its files are damaged.
    """
    return load_built_in(name) if name in BUILT_IN else load_imported(name)
