"""One frame of a moving picture: what points send, what lies behind, all that an eye sees of both."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from relume.brdf.channels import NormalMap, images_of
from relume.look import Look
from relume.moving.again import Part, Shown, resolve_some
from relume.moving.basis.lobes import Lobes, lobes_of
from relume.moving.basis.tables import Tables, tables_of
from relume.moving.beams.show import add_beams
from relume.moving.behind import Caught, lay_over, seen_behind
from relume.moving.bumps import towards_light
from relume.moving.edges import resolve
from relume.moving.evaluate import Sent, send
from relume.moving.highlights.between_points import add_sky_in_highlights
from relume.moving.highlights.by_lights import by_lights
from relume.moving.highlights.glances import glance
from relume.moving.highlights.lobe_lights import MOST_LAMPS, widths_of
from relume.moving.highlights.looking import SkyLight
from relume.moving.highlights.turning import turning
from relume.moving.look_up import Seen, at_vertices
from relume.moving.panes import hide_less, lay_over_glass
from relume.moving.pixels import FromVertices, Mirrored, combine
from relume.moving.points.images import Wears
from relume.moving.points.surface import Surface
from relume.moving.relief.light import ReliefLight
from relume.moving.relief.show import Arrived, Sight, show_texels
from relume.moving.relief.tables import Covers, covers_of
from relume.moving.sky import turn_of
from relume.moving.transfer import MovingTransfer
from relume.moving.vectors.arriving import Arriving
from relume.picture.light import Light, emission_of
from relume.scene.model import Camera

F32 = NDArray[np.float32]


class Projected(NamedTuple):
    """The terms of one material, and what the in-basis and lobes make of them."""

    terms: Sequence[Mapping[str, Any]]
    tables: Tables
    lobes: Lobes


def _projected(terms: Sequence[Mapping[str, Any]], before: Projected | None) -> Projected:
    """Project the terms of one. before: what has been projected of it."""
    if before is not None and before.terms == terms:
        return before
    return Projected(terms, tables_of([terms]), lobes_of([terms]))


class Materials(NamedTuple):
    """What materials send.

    Attributes:
        tables: of what the in-basis tells. lobes: of the rest.
        sends: whether a material sends anything of a group of terms. (materials, groups) bool
        covers: of materials whose every texel sends something else.
        each: the terms of each, projected.
        wears: what a look names in the place of each one's images.
    """

    tables: Tables
    lobes: Lobes
    sends: NDArray[np.bool_]
    covers: Covers
    each: Sequence[Projected]
    wears: tuple[Wears, ...]

    @classmethod
    def of(
        cls,
        terms: Sequence[Sequence[Mapping[str, Any]]],
        before: Self | None = None,
        normals: Sequence[NormalMap | None] | None = None,
        *,
        waits: bool = True,
    ) -> Self:
        """Project the terms of each, of a complete look.

        Args:
            terms: of each. before: those of another, which hold what has not changed.
            normals: in the place of the normal maps of each; None: all have their own.
            waits: see `covers_of`.
        """
        of_normals = [None] * len(terms) if normals is None else normals
        wears = tuple(Wears(images_of(these), one) for these, one in zip(terms, of_normals, strict=True))
        known = before.each if before is not None else [None] * len(terms)
        each = [_projected(these, one) for these, one in zip(terms, known, strict=True)]
        covers = covers_of(terms, before.covers.shown if before is not None else (), waits=waits)
        if before is not None and all(map(operator.is_, each, before.each)):
            is_covered = len(covers.missing) == len(before.covers.missing)
            if before.wears == wears and is_covered:
                return before
            return before._replace(wears=wears, covers=before.covers if is_covered else covers)
        tables, lobes = Tables.joined([one.tables for one in each]), Lobes.joined([one.lobes for one in each])
        sends, with_lobe = np.asarray((tables.of >= 0).any(axis=2)), lobes.of >= 0
        sends[with_lobe] |= np.asarray(lobes.albedo.any(axis=(1, 3)))[lobes.of[with_lobe]]
        return cls(tables, lobes, sends, covers, each, wears)


class Wanted(NamedTuple):
    """What a frame shall show.

    Attributes:
        look: whose materials and background. light: what arrives, by its sources. gain: of all, in each channel. (3,)
        arriving: light vectors of that light. is_rough: they were found quickly.
        relief: what was made of them for texels, in frames of before.
        is_fine: highlights are found for each pixel as for points, and rims of them smoothed (`relume.moving.rims`).
    """

    look: Look
    materials: Materials
    light: Light
    gain: F32
    arriving: Arriving
    is_rough: bool
    relief: ReliefLight
    is_fine: bool


class Sums(NamedTuple):
    """What a frame was summed from.

    Attributes:
        glances: of points along their lobes. (points, 3) float32. sent: by points.
        turning: of points, from `relume.moving.highlights.turning`. (points, 4) float32
        at_vertices: all three of vertices. towards_light: of vertices, see `FromVertices`.
        radiance: along the rays. (rays, 3) float32
    """

    glances: F32
    sent: Sent
    turning: F32
    at_vertices: tuple[F32, F32, F32]
    towards_light: F32
    radiance: F32


class Frame(NamedTuple):
    """A finished one.

    Attributes:
        image: linear radiance. (height, width, 3) float32
        hides: how much of what is behind it, where the background is transparent, else None. (height, width) float32
        sums: what it was summed from.
    """

    image: F32
    hides: F32 | None
    sums: Sums


def frame_of(
    transfer: MovingTransfer,
    wanted: Wanted,
    seen: Seen,
    camera: Camera,
    size: tuple[int, int],
    shares: Sequence[F32] = (),
) -> Frame:
    """Find what an eye sees, but for rims.

    Args:
        transfer: of the bake. wanted: what is shown.
        seen: by the rays of the camera. size: width and height in pixels.
        shares: of each beam that arrives, seen by the rays. (rays,) float32 each
    """
    width, height = size
    found = finished_along(transfer, wanted, seen, camera, height, shares)
    image = resolve(found.radiance, seen.owner, width * height).reshape(height, width, 3)
    if wanted.look.background.kind != "transparent":
        return Frame(image, None, found.sums)
    return Frame(image, resolve(found.hides, seen.owner, width * height).reshape(height, width), found.sums)


class Finished(NamedTuple):
    """What rays show.

    Attributes:
        radiance: with the background. (rays, 3) float32. hides: how much of what is behind them. (rays,) float32
        sums: what it was summed from.
    """

    radiance: F32
    hides: F32
    sums: Sums


def finished_along(
    transfer: MovingTransfer, wanted: Wanted, seen: Seen, camera: Camera, height: int, shares: Sequence[F32] = ()
) -> Finished:
    """Find what rays show, glass and background included.

    Args:
        transfer, wanted, seen, camera, shares: as of `frame_of`. height: of the picture, pixels.
    """
    surface, light = transfer.surface, wanted.light
    sums = _summed(transfer, wanted, seen, Part(seen.is_needed, seen.is_seen, None), camera, height)
    out = sums.radiance
    _add_beams(transfer, wanted, seen, camera, height, shares, None, out)
    if (wanted.gain != 1).any():
        out *= wanted.gain
    caught = _caught(transfer, wanted, seen)
    behind = seen_behind(transfer, wanted.look.background, light, wanted.gain, seen, caught.is_catcher)
    hides = lay_over(surface, seen, behind, caught, wanted.gain, is_direct=light.paths.direct, out=out)
    return Finished(lay_over_glass(seen.panes, out), hide_less(seen.panes, hides), sums)


def only_materials_differ(before: Wanted, after: Wanted) -> bool:
    """Whether two frames of one eye differ in what materials send alone, without any whose light comes otherwise."""
    one, other = before.look, after.look
    catchers = (material.catcher for look in (one, other) for material in look.materials.values())
    return (
        before.arriving is after.arriving
        and [one.normals for one in before.materials.wears] == [one.normals for one in after.materials.wears]
        and before.light._replace(reflectances=after.light.reflectances) == after.light
        and np.array_equal(before.gain, after.gain)
        and one.background == other.background
        and not any(catchers)
        and _are_covered_alike(before.materials, after.materials)
    )


def _are_covered_alike(before: Materials, after: Materials) -> bool:
    """Whether the same BTFs lie on the same materials, none of which was edited."""
    one, other = before.covers.shown, after.covers.shown
    return len(one) == len(other) and all(
        a.material == b.material and a.tables is b.tables and before.each[a.material] is after.each[b.material]
        for a, b in zip(one, other, strict=True)
    )


def shows_texels(transfer: MovingTransfer, materials: Materials, seen: Seen, part: Part) -> bool:
    """Whether any ray of a part of a picture sees a material that a BTF covers.

    Args:
        transfer: of the bake. materials: of the look. seen: by the rays of the picture. part: of it.
    """
    if not materials.covers.shown:
        return False
    face = seen.hits.face if part.rays is None else seen.hits.face[part.rays]
    covered = [cover.material for cover in materials.covers.shown]
    return bool(np.isin(transfer.surface.face_material[face[face >= 0]], covered).any())


def change(
    transfer: MovingTransfer,
    wanted: Wanted,
    seen: Seen,
    camera: Camera,
    frame: Frame,
    shown: Shown,
    words: NDArray[np.uint32],
    shares: Sequence[F32] = (),
) -> None:
    """Bring a frame to what materials send now, where `only_materials_differ` and the part `shows_texels` of no BTF.

    Args:
        transfer, seen, camera, shares: as in `frame_of`. wanted: what is shown from now on.
        frame: changed. words: its pixels, packed; changed too. (pixels,) uint32
        shown: what of it shows those materials.
    """
    height, radiance, rays = len(frame.image), frame.sums.radiance, shown.part.rays
    _summed(transfer, wanted, seen, shown.part, camera, height, frame.sums)
    _add_beams(transfer, wanted, seen, camera, height, shares, rays, radiance)
    if (wanted.gain != 1).any():
        radiance[rays] *= wanted.gain
    resolve_some(radiance, seen.owner, shown, frame.image.reshape(-1, 3), words)


def _summed(
    transfer: MovingTransfer,
    wanted: Wanted,
    seen: Seen,
    part: Part,
    camera: Camera,
    height: int,
    into: Sums | None = None,
) -> Sums:
    """What surfaces send along the rays of a part, and on the way there. into: written there; None: new."""
    materials, arriving = wanted.materials, wanted.arriving
    surface = transfer.surface_with(materials.wears)
    lobes, eye, (points, vertices, rays) = materials.lobes, camera.to_world[:3, 3].astype(np.float32), part
    glances, sent, turns, of_vertices, towards, out = into or (None, None, None, (None,) * 3, None, None)
    glances = _glanced(transfer, wanted, eye, points, glances)
    sky = _sky_in(transfer, wanted.light)
    sent = send(surface, arriving.total, arriving.others, materials.tables, eye, points, sent)
    lit = _lit(transfer, wanted, eye, points)
    add_sky_in_highlights(surface, lobes, sky, eye, glances, lit, points, sent, is_fine=wanted.is_fine)
    turns = turning(surface, arriving.others, materials.tables, lobes, eye, points, turns)
    of_points = sent.radiance, glances, turns
    broad, along, turn = (at_vertices(surface, vertices, *of) for of in zip(of_points, of_vertices, strict=True))
    towards = _towards_light(surface, arriving, seen) if towards is None else towards
    emission = np.array([emission_of(wanted.light, name) for name in transfer.material_names], np.float32)
    pixel_angle, from_vertices = camera.yfov / height, FromVertices(broad, materials.sends, towards)
    mirrored = Mirrored(lobes, sky, along, turn, wanted.is_fine)
    out = combine(surface, seen, pixel_angle, from_vertices, emission, mirrored, rays, out)
    if rays is None:  # else none of them sees a texel
        sight, arrived = Sight(eye, pixel_angle, seen), Arrived(arriving.total, wanted.relief)
        show_texels(materials.covers.shown, transfer.surface, transfer.positions, sight, arrived, out)
    return Sums(glances, sent, turns, (broad, along, turn), towards, out)


def _glanced(transfer: MovingTransfer, wanted: Wanted, eye: F32, points: NDArray[np.uint8], out: F32 | None) -> F32:
    """Look from points along their lobes. out: written; None: new."""
    lobes, light = wanted.materials.lobes, wanted.light
    widths = widths_of(lobes) if light.shows_sky else ()
    if not widths:
        return np.zeros((len(points), 1 + MOST_LAMPS), np.float32) if out is None else out
    listed = transfer.lobe_lights(light.environment, widths)
    return glance(transfer.surface, transfer.seen_lights, listed, lobes, eye, points, out)


def _lit(transfer: MovingTransfer, wanted: Wanted, eye: F32, points: NDArray[np.uint8]) -> F32:
    """What points send of the lights that they see in their highlights."""
    lobes, light = wanted.materials.lobes, wanted.light
    if not (lobes.most == 1).any() or not light.shows_sky:
        return np.zeros((len(points), 3), np.float32)
    lights = transfer.sky_lights(light.environment, is_preview=wanted.is_rough)
    return by_lights(transfer.surface, transfer.seen_lights, lights, lobes, eye, points)


def _add_beams(
    transfer: MovingTransfer,
    wanted: Wanted,
    seen: Seen,
    camera: Camera,
    height: int,
    shares: Sequence[F32],
    rays: NDArray[np.int32] | None,
    out: F32,
) -> None:
    """Add what beams bring along some rays, None for all. out: added to. (rays, 3)"""
    if not wanted.arriving.beams:
        return
    beams, sky = wanted.arriving.beams, _sky_in(transfer, wanted.light)
    of_eye = seen, camera, camera.yfov / height
    add_beams(beams, shares, transfer.surface_with(wanted.materials.wears), *of_eye, wanted.materials, sky, rays, out)


def _towards_light(surface: Surface, arriving: Arriving, seen: Seen) -> F32:
    """Where the light of vertices comes from, which matters under normal maps alone. (vertices or 0, 3)"""
    if not len(surface.tangents):
        return np.empty((0, 3), np.float32)
    return at_vertices(surface, seen.is_seen, towards_light(surface, arriving.total, seen.is_needed))


def _sky_in(transfer: MovingTransfer, light: Light) -> SkyLight:
    """What lobes see where nothing hides it: the sky, its turn, its gain; none where no light comes straight."""
    gain = np.array(light.environment_gain if light.shows_sky else (0.0, 0.0, 0.0), np.float32)
    sky, lamps = transfer.sky_in(light.environment.map), transfer.lamps_in(light.environment)
    return SkyLight(sky, lamps, turn_of(light.environment.rotation), gain)


def _caught(transfer: MovingTransfer, wanted: Wanted, seen: Seen) -> Caught:
    """What would arrive at catchers if nothing were in the way."""
    is_catcher = np.array([wanted.look.materials[name].catcher for name in transfer.material_names])
    if not is_catcher.any():
        return Caught(is_catcher, np.empty((0, 3), np.float32))
    of_points = np.zeros((transfer.surface.points.num_points, 3), np.float32)
    for material in np.flatnonzero(is_catcher):
        of_points += transfer.unhidden(wanted.light, int(material), is_preview=wanted.is_rough)
    return Caught(is_catcher, at_vertices(transfer.surface, seen.is_seen, of_points))
