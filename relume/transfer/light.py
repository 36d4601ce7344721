"""What arrives at the surfaces of a picture, as far as its operators and images depend on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from relume.brdf.albedo import reflectances_of
from relume.look import EnvironmentKey, Look, Paths
from relume.transfer.gathered import Reflectances


class Light(NamedTuple):
    """Pictures of equal light need the same operators.

    Attributes:
        reflectances: of all materials, for light that they reflect onto each other; none where no such light is shown.
        paths: by which light comes, those between surfaces only where they were baked.
    """

    environment: EnvironmentKey
    reflectances: Reflectances
    paths: Paths


def light_of(look: Look, material_names: Sequence[str], *, has_cells: bool) -> Light:
    """The light of a look.

    Args:
        material_names: in the scene's order. has_cells: whether light between surfaces was baked.
    """
    paths = look.transport.paths
    if not has_cells:
        paths = paths.without_reflections()
    if not paths.reflect:
        return Light(look.environment.key, (), paths)
    terms = (look.materials[name].terms for name in material_names)
    return Light(look.environment.key, tuple(map(reflectances_of, terms)), paths)
