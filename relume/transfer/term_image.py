"""The live image of one term of one material: what is free, what it shows, what it should show.

Exactness is tracked as in eqs. 29 to 31, Ben-Artzi 2006: the image belongs to the effective coefficients, and a step
adds T · (c_perfect − c_effective), the most important coefficients first where there is no time for all. Along a
parameter, whose few coefficients say curves only nearly, a step sums all of them, and the image is near its look.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.curves import curve_bands, curve_values
from relume.brdf.registry import TERMS
from relume.errors import EditError
from relume.look.model import Rgb
from relume.transfer.along import Along
from relume.transfer.frozen import Frozen, tiles_of
from relume.transfer.shade import Shaded
from relume.transfer.stream import columns_of, stream

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass(frozen=True)
class Base:
    """What a term showed in the light before, from where changes of light are followed.

    Attributes:
        light: of the image. bands: of each curve, (3, J). image, is_near: as of `TermImage`.
    """

    light: Any
    bands: dict[str, F64]
    image: F32
    is_near: bool


class TermImage:
    """State of one term.

    Attributes:
        target: bands of each curve in the newest look.
        effective: those that `image` shows; None where it shows nothing.
        is_near: it shows them only as closely as the nodes of a parameter can say them.
        is_glimpse: `image` is a rough one, of this light or of the one before.
        base: the last image that was shaded, where that was in another light. followed: light to which it was brought.
        active: what the operator in use leaves free. shown: its coefficients in `image`, (3, columns).
        term: the declaration of the term's model, fixed parameters put in. model: what tells it from others.
        kind: the same and the light.
        image: Σ_j c_j T_j, before colour, texture and outgoing curves. (tiles, 3, samples) float32
        outgoing: product of the curves of the outgoing angle, per sample. (3, samples) float32, or None for 1.
    """

    def __init__(self, document: Mapping[str, Any], cos_theta_o: F64, light: Hashable = None) -> None:
        self._light = light
        self._theta_o = np.arccos(cos_theta_o)
        self.image: F32 = np.zeros((tiles_of(len(cos_theta_o))[0], 3, tiles_of(len(cos_theta_o))[1]), np.float32)
        self.effective: dict[str, F64] | None = None
        self.active: Along | None = None
        self.is_near = self.is_glimpse = False
        self.shown: F64 | None = None
        self.base: Base | None = None
        self.followed: Hashable = None
        self.is_composed = False
        self.model: Hashable = None
        self.kind: Hashable = None
        self.set_document(document)

    def set_document(self, document: Mapping[str, Any]) -> None:
        """A new target; another model, or another value of a fixed parameter, starts from nothing."""
        declared = TERMS[document["model"]]
        model = document["model"], declared.fixed_values(document)
        if model != self.model:
            self.base = None
        if (model, self._light) != self.kind:
            self.effective = self.active = self.shown = None
            self.is_near = False
        elif self.active is not None and not self.active.holds_for(document):
            self.active = self.shown = None
        self.model, self.kind = model, (model, self._light)
        self.document = document
        self.term = declared.settled(document)
        self.target = {curve.name: curve_bands(document, curve) for curve in self.term.curves if not curve.outgoing}
        self.outgoing = self._outgoing()
        self.is_composed = False

    def set_light(self, light: Hashable) -> None:
        """Other light: what the image shows counts for nothing, but stands until there is a new one."""
        if self.effective is not None:
            self.base = Base(self._light, self.effective, self.image.copy(), self.is_near)
        self._light = light
        self.set_document(self.document)
        base = self.base
        if base is not None and base.light == light:  # as before, after all
            self.show(Shaded(base.image), base.bands)
            self.is_near = base.is_near

    def show(self, shaded: Shaded, bands: Mapping[str, F64]) -> None:
        """Go on from an image of these curves, which may have been the target some time ago."""
        self.image[:] = shaded.image
        self.effective, self.base, self.followed = dict(bands), None, None
        self.is_near = self.is_glimpse = self.is_composed = False

    def glimpse(self, image: F32) -> None:
        """Show a rough image, of no curves in particular, until there is a better one."""
        self.followed = None
        self.image[:] = image
        self.is_glimpse, self.is_composed = True, False

    def mix(self, parts: Sequence[tuple[F32, Rgb]], *, from_base: bool) -> None:
        """Show the target in this light: the base or nothing, and images times gains of each channel."""
        base = self.base
        if base is None:
            raise EditError("the term has no image to go on from; shade it first")
        mixed = base.image if from_base else np.zeros_like(self.image)
        for image, gain in parts:
            mixed += np.array(gain, np.float32)[:, None] * image
        self.show(Shaded(mixed), self.target)
        self.is_near = from_base and base.is_near

    def can_follow(self) -> bool:
        """Whether all that the image lacks is a change of light."""
        base = self.base
        return base is not None and self.effective is None and not self._differing(base.bands)

    def is_followed(self) -> bool:
        """Whether it shows its look but for what rows leave out."""
        return self.can_follow() and self.followed == self._light

    def follow(self, add_change: Callable[[F32], None]) -> None:
        """Show the base and what has changed since, which `add_change` adds to an image in place."""
        if self.base is None:
            raise EditError("the term has no image to go on from; shade it first")
        self.image[:] = self.base.image
        add_change(self.image)
        self.followed = self._light
        self.is_glimpse, self.is_composed = True, False

    def _outgoing(self) -> F32 | None:
        curves = [curve for curve in self.term.curves if curve.outgoing]
        if not curves:
            return None
        values = [curve_values(self.document, curve, self._theta_o) for curve in curves]
        return np.asarray(np.prod(values, axis=0), np.float32)

    def differing(self) -> list[str]:
        """Curves whose target the image does not show."""
        return list(self.target) if self.effective is None else self._differing(self.effective)

    def _differing(self, shown: Mapping[str, F64]) -> list[str]:
        return [name for name, bands in self.target.items() if not np.array_equal(bands, shown[name])]

    def is_exact(self) -> bool:
        """Whether the image shows the target."""
        return self.effective is not None and not self.is_near and not self.differing()

    def dormant_key(self, active: Along | None, *, of_target: bool) -> Hashable:
        """What a frozen operator, or an image where nothing is active, depends on besides view and material."""
        bands = self.target if of_target or self.effective is None else self.effective
        return self._key(self.kind, active, bands)

    def key_in(self, light: Hashable) -> Hashable:
        """The same of its image of the target in some light."""
        return self._key((self.model, light), None, self.target)

    def _key(self, kind: Hashable, active: Along | None, bands: Mapping[str, F64]) -> Hashable:
        moved = () if active is None else active.moves
        rows = (bands[name].astype(np.float32).tobytes() for name in sorted(bands) if name not in moved)
        return kind, active, *rows

    def adopt(self, frozen: Frozen, active: Along) -> None:
        """Go on with an operator whose dormant curves are those of the target.

        Where the image shows other curves, or the operator can say them better, it is made anew from all coefficients.
        """
        differing = set(self.differing())
        known = self.active == active  # `shown` holds, also where only some coefficients have been moved
        self.active = active
        if not differing <= set(active.moves) or (differing and not known) or (self.is_near and active.is_complete):
            self._sum(frozen, active)
            self.effective = dict(self.target)
        elif not known:
            self.shown = active.coefficients(self.target)

    def step(self, frozen: Frozen, max_coefficients: int | None) -> int:
        """Bring what is free towards its target (eqs. 29 to 31); returns the number of coefficients moved."""
        active = self.active
        if active is None or self.effective is None or self.shown is None:
            raise EditError("the term has no frozen operator; freeze it first")
        free = {name: self.target[name] for name in active.moves}
        if set(self.differing()).isdisjoint(free):
            return 0
        if not active.is_complete:
            self.effective = {**self.effective, **free}
            return self._sum(frozen, active)
        perfect = active.coefficients(self.target)
        change = perfect - self.shown
        budget = change.size if max_coefficients is None else 3 * max_coefficients
        moved = int(np.count_nonzero(change))
        if moved > budget:
            weight = np.abs(change) * frozen.importance
            change[weight < np.partition(weight.ravel(), -budget)[-budget]] = 0.0
            self.shown = np.where(change == 0, self.shown, perfect)  # a sum would leave a rest to move again
            free = {name: np.full_like(bands, np.nan) for name, bands in free.items()}  # shows no curve exactly
        else:
            self.shown = perfect
        self.effective = {**self.effective, **free}
        stream(frozen.transport, columns_of(change), self.image)
        self.is_composed = False
        return min(moved, budget)

    def _sum(self, frozen: Frozen, active: Along) -> int:
        """Make the image anew from all coefficients of the target; returns their number."""
        self.shown = active.coefficients(self.target)
        self.image[:] = 0
        stream(frozen.transport, columns_of(self.shown), self.image)
        self.is_near = not active.is_complete
        self.is_glimpse = self.is_composed = False
        self.base = self.followed = None
        return self.shown.size
