"""The list of environments made by code. To add one: write it beside this and add it here."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

from relume.assets.environments.environment import Environment
from relume.assets.environments.skies import clear_sky, overcast, sunset
from relume.assets.environments.studio import studio

BUILT_IN: dict[str, tuple[str, Callable[[], Environment]]] = {
    "studio": ("Studio", studio),
    "clear_sky": ("Clear sky", clear_sky),
    "sunset": ("Sunset", sunset),
    "overcast": ("Overcast", overcast),
}


@lru_cache(maxsize=len(BUILT_IN))
def load_built_in(name: str) -> Environment:
    """The environment of that name in `BUILT_IN`, made once in a process. Raises KeyError for another name."""
    environment = BUILT_IN[name][1]()
    environment.radiance.flags.writeable = False
    return environment
