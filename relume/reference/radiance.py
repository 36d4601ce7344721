"""Outgoing radiance of points by brute force: R = Σ V · L ΔΩ · f(ωi, ωo) cos θi over texels and places of local lights,
f the sum of a look's terms."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.basis.bands import MAX_ANGLE
from relume.brdf.channels import channel_of
from relume.brdf.curves import CHANNELS, curve_values, drawn_curves
from relume.brdf.registry import TERMS
from relume.brdf.term import Curve, Term
from relume.memory import stored
from relume.parallel import for_steps
from relume.points import ALIKE
from relume.reference.covers import Cover, cover
from relume.reference.kernel import add_lights, list_visible
from relume.reference.lobes import Lobe, cosine_lobe, lobe_of
from relume.reference.local import Arriving, LocalLamp, free_distance
from relume.reference.texels import Texels
from relume.trace.geometry import Geometry
from relume.trace.visibility import trace_visibility

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Document = Mapping[str, Any]

_STEPS = 1 << 16  # linear between them, the narrowest highlight (σ = 0.005) is off by less than 1e-5 of its peak
_POINTS_A_PACKET = 16  # neighbours that Embree traces together; where texels are drawn, they share the draw
_TEXELS_AT_ONCE = 8192
_MOST_OF_LAMP = 4096  # places of a local light, where every texel is asked for
_SEED = 2006
_COSINE_SHARE, _LOBES_SHARE = 1 / 8, 1 / 4  # of the texels drawn: so many directions more by the cosine and by lobes


@dataclass(frozen=True)
class Points:
    """Points on surfaces, each seen from one direction; neighbours should be near each other.

    Attributes:
        position: off the surface already. normal, tangent: shading frame. wo: towards the viewer. (n, 3) float32
        textures: what multiplies terms of a channel, "diffuse" and "specular". (n, 3) float32 each
        roughness: see `relume.trace.surface.Surface`. (n,) float32
        uv: see there; None where what covers surfaces counts by its mean. (n, 5) float32
        chance: of shadow rays at surfaces that blend; see `relume.points.Points`. (n,) or (1,) float32
    """

    position: F32
    normal: F32
    tangent: F32
    wo: F32
    textures: Mapping[str, F32]
    roughness: F32
    uv: F32 | None = None
    chance: F32 = field(default_factory=lambda: ALIKE)

    @property
    def num_points(self) -> int:
        """n."""
        return len(self.position)

    def frames(self) -> F64:
        """To the local frames, z = normal, x = tangent. (n, 3, 3)"""
        normal = self.normal / np.linalg.norm(self.normal.astype(np.float64), axis=1, keepdims=True)
        tangent = self.tangent / np.linalg.norm(self.tangent.astype(np.float64), axis=1, keepdims=True)
        return np.stack([tangent, np.cross(normal, tangent), normal], axis=1)

    def rows(self, index: slice | NDArray[np.intp]) -> Points:
        """Some of the points."""
        textures = {name: values[index] for name, values in self.textures.items()}
        frame = self.normal[index], self.tangent[index], self.wo[index]
        uv = None if self.uv is None else self.uv[index]
        chance = self.chance if len(self.chance) == 1 else self.chance[index]
        return Points(self.position[index], *frame, textures, self.roughness[index], uv, chance)

    def covers(self, terms: Sequence[Document], rng: np.random.Generator) -> list[Cover | None]:
        """What covers them, term by term; None where it is the same everywhere. rng: draws places in it."""
        found: list[Cover | None] = []
        for document in terms:
            texels = TERMS[document["model"]].settled(document).texels
            if texels is None or self.uv is None:
                found.append(None)
                continue
            wo = np.einsum("nij,nj->ni", self.frames(), self.wo.astype(np.float64))
            found.append(cover(texels, self.uv, wo / np.linalg.norm(wo, axis=1, keepdims=True), rng))
        return found


@dataclass(frozen=True)
class _Tables:
    """A term with the curves that depend on wi tabulated; see `relume.reference.kernel.add_lights`."""

    document: Document
    term: Term
    kinds: NDArray[np.int64]
    axes: F64
    values: F64
    is_stepped: NDArray[np.bool_]
    is_gray: NDArray[np.bool_]
    cover: Cover | None = None


def _tabulate(document: Document) -> _Tables:
    return _tables_of(json.dumps(document, sort_keys=True))


@stored("tables of brute force")
def _tables_of(term_text: str) -> _Tables:
    """Paths ask for the terms of a scene at every bounce, of rough and smooth texels; some megabytes each."""
    document = json.loads(term_text)
    term = TERMS[document["model"]].settled(document)
    curves = [curve for curve in term.curves if not curve.outgoing]
    gamma = np.linspace(0.0, MAX_ANGLE, _STEPS + 1)
    values = np.array([curve_values(document, curve, gamma) for curve in curves]).reshape(len(curves), 3, _STEPS + 1)
    is_stepped = np.array([_stepped(document, curve) for curve in curves], np.bool_).reshape(-1, 3)
    is_gray = np.array([bool(np.all(value == value[0])) for value in values], np.bool_)
    kinds = np.array([int(curve.angle) for curve in curves], np.int64)
    axes = np.array([curve.axes for curve in curves]).reshape(-1, 3)
    return _Tables(document, term, kinds, axes, values, is_stepped, is_gray)


def _stepped(document: Document, curve: Curve) -> list[bool]:
    """Per channel, whether the curve was given as bands: it jumps from one to the next, at entries of the table."""
    stepped = [False] * 3
    for drawn in drawn_curves(document, curve):
        for channel in drawn.get("channels", CHANNELS):
            stepped[CHANNELS.index(channel)] = "bands" in drawn
    return stepped


def reference_radiance(
    geometry: Geometry,
    texels: Texels,
    points: Points,
    materials: Sequence[Sequence[Document]],
    spp: int = 0,
    progress: Callable[[float], object] = lambda share: None,
    cancelled: Callable[[], bool] = lambda: False,
    pass_index: int = 0,
    lamps: Sequence[LocalLamp] = (),
) -> F64:
    """Radiance of all points under several materials, which share their shadow rays.

    Args:
        geometry: in which shadow rays are traced.
        texels: of the environment, with their radiance and solid angles.
        points: n of them, seen from one direction each.
        materials: of each its terms, as they stand in a complete look.
        spp: texels drawn by power for each point, with some directions more by how the materials reflect, and places
            drawn of each lamp that has an extent; 0, or as many as there are, for the middles of all texels.
        progress: called with the share of the points that are done, in [0, 1].
        cancelled: asked between packets of points.
        pass_index: passes with other indices draw independently.
        lamps: local lights, which are added.
    Returns:
        (materials, n, 3) float64
    Raises:
        CancelledError: `cancelled` said so.
    Cost: O(n · min(spp, texels) · (log triangles + terms)) time; some MB of memory a thread.
    """
    tables = [[_tabulate(document) for document in terms] for terms in materials]
    lobes = _lobes_of(tables, spp) if 0 < spp < texels.num_texels else []
    radiance = np.zeros((len(materials), points.num_points, 3))

    def packet(start: int, stop: int) -> None:
        some = points.rows(slice(start, stop))
        here = _covered(tables, some, np.random.default_rng((_SEED, pass_index, start, 2)))
        if lobes:
            rng = np.random.default_rng((_SEED, pass_index, start))
            _add_drawn(geometry, texels, spp, lobes, some, here, rng, radiance[:, start:stop])
        for first in range(0, 0 if lobes else texels.num_texels, _TEXELS_AT_ONCE):
            rows = slice(first, first + _TEXELS_AT_ONCE)
            _add_texels(geometry, texels.direction[rows], texels.power[rows], some, here, radiance[:, start:stop])
        rng = np.random.default_rng((_SEED, pass_index, start, 1))
        for lamp in lamps:
            position, num = some.position.astype(np.float64), spp or _MOST_OF_LAMP
            arriving = lamp.arriving(geometry, position, num, rng, some.chance)
            _add_lamp(arriving, some, here, radiance[:, start:stop])

    for_steps(packet, points.num_points, _POINTS_A_PACKET, progress, cancelled, "the reference")
    return radiance


def _covered(
    tables: Sequence[Sequence[_Tables]], points: Points, rng: np.random.Generator
) -> Sequence[Sequence[_Tables]]:
    """The same of terms that cover a packet of points, with what covers it."""
    if points.uv is None or not any(table.term.texels is not None for terms in tables for table in terms):
        return tables
    found = []
    for terms in tables:
        covers = points.covers([table.document for table in terms], rng)
        found.append([replace(table, cover=one) for table, one in zip(terms, covers, strict=True)])
    return found


def _add_texels(
    geometry: Geometry, direction: F64, power: F64, points: Points, tables: Sequence[Sequence[_Tables]], out: F64
) -> None:
    """Add the light of some texels to a packet of points. out: (materials, points, 3)"""
    towards = np.ascontiguousarray(direction, np.float32)
    visible = trace_visibility(geometry.embree, points.position, points.normal, towards, points.chance).visible
    for p in range(points.num_points):
        _add_lights(points, p, direction, power, visible[p], tables, out[:, p])


def _lobes_of(tables: Sequence[Sequence[_Tables]], spp: int) -> list[tuple[Lobe, int]]:
    """What reflects much of the materials, and how many directions are drawn of each."""
    narrow = [lobe for terms in tables for table in terms for lobe in _narrow(table)]
    each = max(1, round(_LOBES_SHARE * spp / max(1, len(narrow))))
    return [(cosine_lobe(), max(1, round(_COSINE_SHARE * spp))), *((lobe, each) for lobe in narrow)]


def _narrow(table: _Tables) -> list[Lobe]:
    curves = [curve for curve in table.term.curves if not curve.outgoing]
    found = (
        lobe_of(curve.angle, curve.axes, values.mean(axis=0))
        for curve, values in zip(curves, table.values, strict=True)
    )
    return [lobe for lobe in found if lobe is not None]


def lobes_of(terms: Sequence[Document]) -> list[Lobe]:
    """Find what reflects much of a material: all about the normal, then each lobe of its terms.

    Args:
        terms: as they stand in a complete look.
    """
    return [cosine_lobe(), *(lobe for document in terms for lobe in _narrow(_tabulate(document)))]


def _add_drawn(
    geometry: Geometry,
    texels: Texels,
    spp: int,
    lobes: Sequence[tuple[Lobe, int]],
    points: Points,
    tables: Sequence[Sequence[_Tables]],
    rng: np.random.Generator,
    out: F64,
) -> None:
    """Add the environment's light to a packet of points: directions drawn by power, which they share, and directions
    drawn of each point's lobes; each is divided by how often all of them together draw it. out: (materials, points, 3)
    """
    frames = points.frames()
    wo = np.einsum("nij,nj->ni", frames, points.wo.astype(np.float64))
    shared = texels.drawn(spp, rng)
    towards = shared.astype(np.float32)
    seen = trace_visibility(geometry.embree, points.position, points.normal, towards, points.chance).visible
    is_seen = np.unpackbits(seen, axis=1, count=spp, bitorder="little").astype(bool)
    own = np.concatenate([lobe.draw(wo, num, rng) for lobe, num in lobes], axis=1)
    wi = np.concatenate([np.einsum("nij,mj->nmi", frames, shared), own], axis=1)
    own = np.einsum("nji,nmj->nmi", frames, own)
    num = own.shape[1]
    starts, chance = np.repeat(points.position, num, axis=0), points.chance
    chance = chance if len(chance) == 1 else np.repeat(chance, num)
    free = free_distance(geometry, starts, own.reshape(-1, 3).astype(np.float32), chance).reshape(own.shape[:2])
    is_free = np.concatenate([is_seen, np.isinf(free)], axis=1)
    direction = np.concatenate([np.broadcast_to(shared, (points.num_points, *shared.shape)), own], axis=1)
    radiance, density = texels.radiance(direction)
    expected = spp * density + sum(num * lobe.density_of(wi, wo) for lobe, num in lobes)
    power = radiance * (is_free / np.maximum(expected, 1e-300))[..., None]
    _add_lamp(Arriving(direction, power), points, tables, out)


def _add_lamp(arriving: Arriving, points: Points, tables: Sequence[Sequence[_Tables]], out: F64) -> None:
    """Add the light of a lamp to a packet of points. out: (materials, points, 3)"""
    visible = np.packbits(arriving.power.any(axis=2), axis=1, bitorder="little")
    for p in range(points.num_points):
        _add_lights(points, p, arriving.direction[p], arriving.power[p], visible[p], tables, out[:, p])


def _add_lights(
    points: Points,
    p: int,
    direction: F64,
    power: F64,
    visible: NDArray[np.uint8],
    tables: Sequence[Sequence[_Tables]],
    out: F64,
) -> None:
    """Add light from directions (m, 3) to one point. power: (m, 3). visible: bits. out: (materials, 3)"""
    wi, light = np.empty((3, len(direction))), np.empty(len(direction), np.int64)
    frame = np.stack([points.normal[p], points.tangent[p], points.wo[p]]).astype(np.float64)
    normal, tangent, wo = frame / np.linalg.norm(frame, axis=1, keepdims=True)
    num, ox, oy, oz = list_visible(normal, tangent, wo, visible, direction, wi, light)
    if num == 0:
        return
    x, y, z = wi[:, :num]
    for m, terms in enumerate(tables):
        for table in terms:
            if table.cover is None:
                shading = table.term.quotients(x, y, z, ox, oy, oz) * z
            else:
                shading = np.ascontiguousarray(table.cover.sent(np.full(num, p), wi[:, :num].T).T)
            total = np.zeros(3)
            add_lights(
                table.kinds, table.axes, table.values, table.is_stepped, table.is_gray,
                light, num, wi, ox, oy, oz, shading, power, total,
            )  # fmt: skip
            out[m] += total * _factor(table, points, p, oz)


def _factor(table: _Tables, points: Points, p: int, cos_theta_o: float) -> F64:
    """Colour, texture and curves of the outgoing angle. (3,)"""
    factor = np.asarray(table.document["color"], np.float64)
    channel = channel_of(table.document)
    if channel is not None:
        factor = factor * points.textures[channel][p]
    theta_o = np.arccos(np.clip(np.array([cos_theta_o]), 0.0, 1.0))
    for curve in table.term.curves_in(table.document):
        if curve.outgoing:
            factor = factor * curve_values(table.document, curve, theta_o)[:, 0]
    return factor
