"""Environments that a look may name in place of the scene's own: "env:<id>" is imported, other names are built in."""

from __future__ import annotations

from relume.environments.asset_store import STORE, imported
from relume.environments.built_in import BUILT_IN, built_in
from relume.environments.model import Environment


def is_known(name: str) -> bool:
    """Whether a look's `map` names an environment that is here."""
    return name in BUILT_IN or STORE.is_known(name)


def known_names() -> list[str]:
    """The names that a look's `map` may have."""
    return [*BUILT_IN, *STORE.known_names()]


def find(name: str) -> Environment:
    """The environment that a look's `map` names.

    Raises:
        NotFoundError: it is not here. SceneError: its files are damaged.
    """
    return built_in(name) if name in BUILT_IN else imported(name)
