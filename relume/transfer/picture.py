"""One live picture: a view under a look that changes while somebody drags."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.basis.daubechies import analysis, synthesis
from relume.brdf.curves import curve_bands, generated_bands
from relume.color import luminance
from relume.errors import EditNotSupportedError, ParameterError
from relume.look import Look, validate
from relume.transfer.cache import FrozenCache
from relume.transfer.frozen import Frozen, freeze, frozen_bytes
from relume.transfer.material_image import MaterialImage
from relume.transfer.opened import Transfer
from relume.transfer.pointer import CurvePointer, parse_pointer
from relume.transfer.resolve import encode, resolve
from relume.transfer.shade import Shaded, shade, shaded_bytes
from relume.transfer.stream import columns_of, stream
from relume.transfer.term_image import TermImage
from relume.transfer.view import Tile

F32 = NDArray[np.float32]


@dataclass(frozen=True)
class Advance:
    """What one step changed.

    Attributes:
        tiles: x, y, width, height of the picture's tiles that are new. exact: the picture shows its look exactly.
    """

    tiles: list[Tile]
    exact: bool

    @property
    def changed(self) -> bool:
        """Whether any pixel may be new."""
        return bool(self.tiles)


@dataclass(frozen=True)
class _Need:
    """What the picture needs to go on: an operator along `active`, or an image where that is None."""

    material: MaterialImage
    term: TermImage
    active: str | None


class Picture:
    """State of one session's picture; used from one thread at a time."""

    def __init__(self, transfer: Transfer, view_name: str, cache: FrozenCache) -> None:
        self._transfer, self._cache = transfer, cache
        self._view = transfer.views[view_name]
        self._default = self._look = validate(transfer.default_look, transfer.default_look)
        self._materials = {
            name: MaterialImage(self._view, index, self._look.materials[name].terms)
            for index, name in enumerate(transfer.material_names)
        }
        self._radiance = np.zeros((3, self._view.num_view_samples), np.float32)
        self._gain = np.full(3, -1.0)  # no environment's: nothing is shown yet
        self._baked_rotation = self._look.environment.rotation
        self._touched: CurvePointer | None = None

    def set_look(self, look: Look) -> None:
        """A new target; nothing is computed yet.

        Raises:
            EditNotSupportedError: the bake cannot follow it.
        """
        if look.environment.rotation != self._baked_rotation:
            raise EditNotSupportedError(self._transfer.method, "the environment's rotation")
        for name, material in self._materials.items():
            material.set_documents(look.materials[name].terms)
        self._look = look

    def touch(self, pointer: str) -> None:
        """Prepare a curve ahead of the first edit, e.g. "/materials/Teapot/terms/1/curves/theta_h"."""
        self._find(parse_pointer(pointer))
        self._touched = parse_pointer(pointer)

    def waiting(self) -> str | None:
        """What must be frozen before the picture can go on, in words; None where it can."""
        need = self._need()
        if need is None:
            return None
        name = self._transfer.material_names[need.material.index]
        label = need.term.term.label if need.active is None else need.term.term.curve(need.active).label
        return f"{name}, {label}"

    def freeze(self, progress: Callable[[float], None], cancelled: Callable[[], bool]) -> None:
        """Freeze, or shade, what `waiting` named.

        Raises:
            CancelledError: `cancelled` said so; the picture stays as it was.
            MemoryBudgetError: the operator is larger than the cache may be.
        """
        need = self._need()
        if need is None:
            return
        if need.active is None:
            need.term.show(self._shaded(need, progress, cancelled))
            return
        need.term.adopt(self._frozen(need, need.active, progress, cancelled), need.active)
        if self._touched is not None and self._touched_term() != need and self._find(self._touched)[1] is need.term:
            self._touched = None  # the hand has moved on to another curve of this term

    def _shaded(self, need: _Need, progress: Callable[[float], None], cancelled: Callable[[], bool]) -> Shaded:
        material, term = need.material, need.term
        key = self._key(material, term, None, of_target=True)

        def make() -> Shaded:
            receivers = self._view.receivers(material.index)
            return shade(term.term, term.target, self._transfer.lights, receivers, progress, cancelled)

        def make_once() -> Shaded:
            name = self._transfer.material_names[material.index]
            is_default = term.document in self._default.materials[name].terms
            return self._transfer.derived.get(key[1:], term.image.shape, make) if is_default else make()

        return self._cache.get(key, Shaded, shaded_bytes(material.num_samples), make_once)

    def _frozen(
        self, need: _Need, active: str, progress: Callable[[float], None], cancelled: Callable[[], bool]
    ) -> Frozen:
        material, term = need.material, need.term

        def make() -> Frozen:
            receivers = self._view.receivers(material.index)
            return freeze(term.term, term.target, active, self._transfer.lights, receivers, progress, cancelled)

        num_bytes = frozen_bytes(material.num_samples, term.term.curve(active).num_bands)
        return self._cache.get(self._key(material, term, active, of_target=True), Frozen, num_bytes, make)

    def advance(self, max_coefficients: int | None) -> Advance:
        """Bring the picture towards its look: R += T · Δc with the most important coefficients, None for all."""
        for material in self._materials.values():
            for term in material.changed_terms():
                frozen = self._operator(material, term)
                if frozen is not None:
                    term.step(frozen, max_coefficients)
        tiles: set[Tile] = set()
        exact = True
        for index, material in enumerate(self._materials.values()):
            if material.num_samples == 0:
                continue
            if material.compose(self._radiance):
                tiles.update(self._view.tiles_of_material[index])
            exact = exact and not any(True for _ in material.changed_terms())
        if not np.array_equal(self._gain, self._look.environment.gain):
            self._gain = np.array(self._look.environment.gain)
            first = self._view.num_surface_samples
            self._radiance[:, first:] = self._view.background().T
            tiles.update(self._view.all_tiles)
        return Advance(sorted(tiles, key=lambda tile: (tile[1], tile[0])), exact)

    def all_tiles(self) -> list[Tile]:
        """Tiles that cover the picture."""
        return self._view.all_tiles

    def encode(self, tiles: Sequence[Tile], form: str) -> bytes:
        """Payload of a frame, "rgb9e5" or "f32": the tiles one after another, row-major."""
        return encode(self._view, self._radiance, tiles, form, self._gain)

    def image(self) -> F32:
        """Linear radiance. (height, width, 3) float32"""
        whole = [(0, 0, self._view.width, self._view.height)]
        pixels = resolve(self._view, self._radiance, whole, self._gain)
        return pixels.reshape(self._view.height, self._view.width, 3)

    def curve(self, pointer: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Bands of a curve as displayed and as its parameters alone would give it. (3, J) each"""
        _, term, curve = self._find(parse_pointer(pointer))
        declared = term.term.curve(curve)
        return curve_bands(term.document, declared), generated_bands(term.document, declared)

    def probe(self, x: int, y: int) -> dict[str, Any]:
        """A pixel's material, radiance, and what each band of its active curve gives to it.

        Raises:
            ParameterError: the pixel lies outside the picture.
        """
        view = self._view
        if not (0 <= x < view.width and 0 <= y < view.height):
            raise ParameterError("pixel", [x, y], f"x below {view.width} and y below {view.height}")
        pixel = y * view.width + x
        entries = slice(int(view.first[pixel]), int(view.first[pixel + 1]))
        samples, weights = view.order[entries], view.weight[entries]
        radiance = self._gain * (self._radiance[:, samples] * weights).sum(axis=1)
        heaviest = int(samples[np.argmax(weights)])
        index = int(np.searchsorted(view.bounds, heaviest, side="right")) - 1
        if index >= len(self._materials):
            return {"material": None, "radiance": radiance, "bands": None, "curve": None}
        name = self._transfer.material_names[index]
        pointer, bands = self._contributions(name, samples, weights)
        return {"material": name, "radiance": radiance, "bands": bands, "curve": pointer}

    def _contributions(
        self, name: str, samples: NDArray[np.int32], weights: F32
    ) -> tuple[str | None, NDArray[np.float64] | None]:
        """T_j · c_j of the material's active curve, summed over a pixel's samples. (3, J)"""
        material = self._materials[name]
        rows = self._view.rows(material.index)
        for k, term in self._active_first(name, material):
            frozen = self._operator(material, term)
            if frozen is None or term.active is None:
                continue
            curve = synthesis(term.shown) if term.shown is not None else term.target[term.active]
            bands = np.zeros_like(curve)
            for sample, weight in zip(samples, weights, strict=True):
                if rows.start <= sample < rows.stop:
                    row = int(sample) - rows.start
                    tile, offset = divmod(row, frozen.transport.shape[3])
                    columns = synthesis(frozen.transport[tile, :, :, offset].astype(np.float64))
                    bands += weight * columns * material.factors_at(term, row)[:, None] * curve
            return str(CurvePointer(name, k, term.active)), self._gain[:, None] * bands
        return None, None

    def _active_first(self, name: str, material: MaterialImage) -> list[tuple[int, TermImage]]:
        terms = list(enumerate(material.terms))
        if self._touched is not None and self._touched.material == name:
            touched = self._touched.term
            terms.sort(key=lambda item: item[0] != touched)
        return terms

    def brush(self, pointer: str, from_deg: float, to_deg: float) -> F32:
        """How much of each pixel comes from a stretch of a curve, 0 to 1. (height, width) float32

        Raises:
            EditNotSupportedError: the curve is not frozen yet; touch it and freeze first.
        """
        material, term, curve = self._find(parse_pointer(pointer))
        frozen = self._operator(material, term)
        if frozen is None or term.active != curve or term.shown is None:
            raise EditNotSupportedError(self._transfer.method, "a brush over a curve that is not open; open it first")
        bands = synthesis(term.shown)
        edges = np.linspace(0, 90, bands.shape[1] + 1)
        overlap = np.clip(np.minimum(edges[1:], to_deg) - np.maximum(edges[:-1], from_deg), 0, None) / np.diff(edges)
        part = np.zeros_like(term.image)
        stream(frozen.transport, columns_of(analysis(bands * overlap)), part)
        radiance = np.zeros_like(self._radiance)
        material.term_radiance(term, part, radiance)
        whole = [(0, 0, self._view.width, self._view.height)]
        lit = luminance(np.maximum(resolve(self._view, radiance, whole, 1.0), 0))
        total = luminance(resolve(self._view, self._radiance, whole, 1.0))
        share = np.divide(lit, total, out=np.zeros_like(lit), where=total > 1e-9)
        return np.clip(share, 0, 1).reshape(self._view.height, self._view.width).astype(np.float32)

    def _find(self, pointer: CurvePointer) -> tuple[MaterialImage, TermImage, str]:
        material = self._materials.get(pointer.material)
        if material is None or not pointer.term < len(material.terms):
            raise ParameterError(str(pointer), pointer.material, "a material and term of this look")
        term = material.terms[pointer.term]
        if pointer.curve not in {curve.name for curve in term.term.curves}:
            raise ParameterError(str(pointer), pointer.curve, ", ".join(curve.name for curve in term.term.curves))
        return material, term, pointer.curve

    def _key(
        self, material: MaterialImage, term: TermImage, active: str | None, *, of_target: bool
    ) -> tuple[Hashable, ...]:
        return (
            self._transfer.key, self._view.name, material.index, term.dormant_key(active, of_target=of_target),
        )  # fmt: skip

    def _operator(self, material: MaterialImage, term: TermImage) -> Frozen | None:
        """The operator that the term's image follows now, unless the cache has dropped it."""
        if term.active is None or term.effective is None:
            return None
        return self._cache.find(self._key(material, term, term.active, of_target=False), Frozen)

    def _need(self) -> _Need | None:
        """The next operator to freeze: first what the look lacks, then what the user has opened."""
        touched = self._touched_term()
        for material in self._materials.values():
            for term in material.changed_terms():
                differing = term.differing()
                if term.active in differing and self._operator(material, term) is not None:
                    continue  # the hand moves this curve: follow it, the others when it rests
                if not material.num_samples:
                    continue
                preferred = touched.active if touched is not None and touched.term is term else None
                if preferred not in differing:
                    preferred = None if term.effective is None else differing[0]
                return _Need(material, term, preferred)
        if touched is not None and touched.material.num_samples and touched.active in touched.term.target:
            current = (
                touched.term.active == touched.active and self._operator(touched.material, touched.term) is not None
            )
            if not current and touched.term.is_exact():
                return touched
        return None

    def _touched_term(self) -> _Need | None:
        if self._touched is None:
            return None
        try:
            return _Need(*self._find(self._touched))
        except ParameterError:  # an edit has removed it
            self._touched = None
            return None
