"""One frame of a moving picture: what points send, what lies behind, all that an eye sees of both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from relume.look import Look
from relume.moving.arriving import Arriving
from relume.moving.basis.lobes import Lobes, lobes_of
from relume.moving.behind import Caught, lay_over, seen_behind
from relume.moving.between_points import SkyLight, take_off_lobes
from relume.moving.bumps import towards_light
from relume.moving.edges import resolve
from relume.moving.evaluate import Tables, send, tables_of
from relume.moving.glints import glance
from relume.moving.look_up import Seen, at_vertices
from relume.moving.panes import hide_less, lay_over_glass
from relume.moving.pixels import Mirrored, Sent, combine
from relume.moving.relief.show import Sight, show_texels
from relume.moving.relief.tables import Cover, covers_of
from relume.moving.sky import turn_of
from relume.moving.transfer import MovingTransfer
from relume.picture.light import Light, emission_of
from relume.scene.model import Camera

F32 = NDArray[np.float32]


class Materials(NamedTuple):
    """What materials send.

    Attributes:
        tables: of what the in-basis tells. lobes: of the rest.
        sends: whether a material sends anything of a group of terms. (materials, groups) bool
        covers: of materials whose every texel sends something else.
    """

    tables: Tables
    lobes: Lobes
    sends: NDArray[np.bool_]
    covers: Sequence[Cover]

    @classmethod
    def of(cls, terms: Sequence[Sequence[Mapping[str, Any]]]) -> Self:
        """Project the terms of each, of a complete look."""
        tables, lobes = tables_of(terms), lobes_of(terms)
        sends, with_lobe = np.asarray((tables.of >= 0).any(axis=2)), lobes.of >= 0
        sends[with_lobe] |= np.asarray(lobes.albedo.any(axis=(1, 3)))[lobes.of[with_lobe]]
        return cls(tables, lobes, sends, covers_of(terms))


class Wanted(NamedTuple):
    """What a frame shall show.

    Attributes:
        look: whose materials and background. light: what arrives, by its sources. gain: of all, in each channel. (3,)
        arriving: light vectors of that light. is_rough: they were found quickly.
    """

    look: Look
    materials: Materials
    light: Light
    gain: F32
    arriving: Arriving
    is_rough: bool


class Frame(NamedTuple):
    """A finished one.

    Attributes:
        image: linear radiance. (height, width, 3) float32
        hides: how much of what is behind it, where the background is transparent, else None. (height, width) float32
    """

    image: F32
    hides: F32 | None


def frame_of(transfer: MovingTransfer, wanted: Wanted, seen: Seen, camera: Camera, size: tuple[int, int]) -> Frame:
    """Find what an eye sees.

    Args:
        transfer: of the bake. wanted: what is shown.
        seen: by the rays of the camera. size: width and height in pixels.
    """
    (width, height), surface, light = size, transfer.surface, wanted.light
    out = _radiance(transfer, wanted, seen, camera, height)
    if (wanted.gain != 1).any():
        out *= wanted.gain
    caught = _caught(transfer, wanted, seen)
    behind = seen_behind(transfer, wanted.look.background, light, wanted.gain, seen, caught.is_catcher)
    hides = lay_over(surface, seen, behind, caught, wanted.gain, is_direct=light.paths.direct, out=out)
    out, hides = lay_over_glass(seen.panes, out), hide_less(seen.panes, hides)
    image = resolve(out, seen.owner, width * height).reshape(height, width, 3)
    if wanted.look.background.kind != "transparent":
        return Frame(image, None)
    return Frame(image, resolve(hides, seen.owner, width * height).reshape(height, width))


def _radiance(transfer: MovingTransfer, wanted: Wanted, seen: Seen, camera: Camera, height: int) -> F32:
    """What surfaces send along the rays. (rays, 3)"""
    surface, (tables, lobes, sends, covers), arriving = transfer.surface, wanted.materials, wanted.arriving
    eye = camera.to_world[:3, 3].astype(np.float32)
    glances = glance(surface, transfer.sky_share, arriving.others, lobes, eye, seen.is_needed)
    sky, sent_by_points = _sky_in(transfer, wanted.light), send(surface, arriving.total, tables, eye, seen.is_needed)
    take_off_lobes(surface, lobes, sky, eye, glances, seen.is_needed, sent_by_points)
    broad = at_vertices(surface, seen.is_seen, sent_by_points)
    mirrored = Mirrored(lobes, sky, at_vertices(surface, seen.is_seen, glances))
    emission = np.array([emission_of(wanted.light, name) for name in transfer.material_names], np.float32)
    pixel_angle, towards = camera.yfov / height, _towards_light(transfer, arriving, seen)
    out = combine(surface, seen, pixel_angle, Sent(broad, sends, towards), emission, mirrored)
    sight = Sight(eye, pixel_angle, seen)
    show_texels(covers, surface, transfer.positions, sight, arriving.total, emission, out)
    return out


def _towards_light(transfer: MovingTransfer, arriving: Arriving, seen: Seen) -> F32:
    """Where the light of vertices comes from, which matters under normal maps alone. (vertices or 0, 3)"""
    surface = transfer.surface
    if not len(surface.tangents):
        return np.empty((0, 3), np.float32)
    return at_vertices(surface, seen.is_seen, towards_light(surface, arriving.total, seen.is_needed))


def _sky_in(transfer: MovingTransfer, light: Light) -> SkyLight:
    """What lobes see where nothing hides it: the sky, its turn, its gain; none where no light comes straight."""
    is_seen = light.paths.direct and light.is_environment_lit
    gain = np.array(light.environment_gain if is_seen else (0.0, 0.0, 0.0), np.float32)
    return SkyLight(transfer.sky_in(light.environment.map), turn_of(light.environment.rotation), gain)


def _caught(transfer: MovingTransfer, wanted: Wanted, seen: Seen) -> Caught:
    """What would arrive at catchers if nothing were in the way."""
    is_catcher = np.array([wanted.look.materials[name].catcher for name in transfer.material_names])
    if not is_catcher.any():
        return Caught(is_catcher, np.empty((0, 3), np.float32))
    of_points = np.zeros((transfer.surface.points.num_points, 3), np.float32)
    for material in np.flatnonzero(is_catcher):
        of_points += transfer.unhidden(wanted.light, int(material), is_preview=wanted.is_rough)
    return Caught(is_catcher, at_vertices(transfer.surface, seen.is_seen, of_points))
