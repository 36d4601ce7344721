"""Environment maps that a look may name: "env:<id>" is imported, other names are built in."""

from __future__ import annotations

from relume.assets.environments.built_in import BUILT_IN, load_built_in
from relume.assets.environments.environment import Environment
from relume.assets.environments.environment_store import STORE, load_imported


def environment_exists(name: str) -> bool:
    """Whether a look's `map` names an environment that is here."""
    return name in BUILT_IN or STORE.exists(name)


def environment_names() -> list[str]:
    """The names that a look's `map` may have."""
    return [*BUILT_IN, *STORE.list_names()]


def load_environment(name: str) -> Environment:
    """The environment that a look's `map` names.

    Raises:
        NotFoundError: it is not here. SceneError: its files are damaged.
    """
    return load_built_in(name) if name in BUILT_IN else load_imported(name)
