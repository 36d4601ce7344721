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
from relume.transfer.fidelity import Fidelity, worst
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


@dataclass(frozen=True)
class Front:
    """What the picture goes on showing of a term until all terms can be shown in another light.

    Attributes:
        image, lit: as of `TermImage`. fidelity: how near it was to its look.
    """

    image: F32
    lit: Hashable
    fidelity: Fidelity


class TermImage:
    """State of one term.

    Attributes:
        target: bands of each curve in the newest look.
        effective: those that `image` shows; None where it shows nothing.
        is_near: it shows them only as closely as the nodes of a parameter can say them.
        lit: light of `image`; None where it shows nothing.
        front: what the picture shows instead of `image`, where not all terms have their image in one light.
        is_glimpse: `image` is a rough one. glimpsed: bands of each curve in it, where it is or was the first of all.
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
        self.lit: Hashable = None
        self.front: Front | None = None
        self.glimpsed: dict[str, F64] = {}
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
            self.effective = self.active = self.shown = self.followed = None
            self.is_near = self.is_glimpse = False
        elif self.active is not None and not self.active.holds_for(document):
            self.active = self.shown = None
        self.model, self.kind = model, (model, self._light)
        self.document = document
        self.term = declared.settled(document)
        self.target = {curve.name: curve_bands(document, curve) for curve in self.term.curves if not curve.outgoing}
        self.outgoing = self._outgoing()
        self.is_composed = False

    def set_light(self, light: Hashable) -> None:
        """Other light: what the image shows counts for nothing, but the picture goes on showing it (`release`)."""
        if self.effective is not None:
            self.base = Base(self._light, self.effective, self.image, self.is_near)
        if self.front is None:
            self.front = Front(self.image, self.lit, worst([self.fidelity, "approximate"]))
        self.image, self.lit = np.zeros_like(self.image), None
        self._light, is_composed = light, self.is_composed
        self.set_document(self.document)
        self.is_composed = is_composed
        base = self.base
        if base is not None and base.light == light:  # as before, after all
            self.show(Shaded(base.image), base.bands)
            self.is_near = base.is_near

    def release(self) -> None:
        """Every term has its image in one light: the picture shows this one from now on."""
        if self.front is not None:
            self.front, self.is_composed = None, False

    @property
    def displayed(self) -> F32:
        """What the picture shows of it."""
        return self.image if self.front is None else self.front.image

    @property
    def is_blank(self) -> bool:
        """Whether the picture shows nothing of it, and there is nothing yet that it could."""
        return self.lit is None and (self.front is None or self.front.lit is None)

    def _show_in(self, light: Hashable) -> None:
        """`image` is a new one, in this light."""
        self.lit = light
        self.is_composed = self.front is not None and self.is_composed

    def show(self, shaded: Shaded, bands: Mapping[str, F64]) -> None:
        """Go on from an image of these curves, which may have been the target some time ago."""
        self.image[:] = shaded.image
        self.effective, self.base, self.followed = dict(bands), None, None
        self.is_near = self.is_glimpse = False
        self._show_in(self._light)

    def glimpse(self, image: F32, bands: Mapping[str, F64], light: Hashable) -> None:
        """Show a rough image of these curves in some light until there is a better one."""
        self.followed = None
        self.image[:] = image
        self.is_glimpse, self.glimpsed = True, dict(bands)
        self._show_in(light)

    def is_roughly_shown(self) -> bool:
        """Whether its look can be seen, so that the image itself may wait for the hand to rest.

        Where the light has changed every position of the hand brings another glimpse; the first one of all, of a
        picture that has just been opened, is the only one, and knows nothing of curves that were moved since.
        """
        return self.is_glimpse and (self.base is not None or not self._differing(self.glimpsed))

    def mix(self, parts: Sequence[tuple[F32, Rgb]], *, from_base: bool) -> None:
        """Show the target in this light: the base or nothing, and images times gains of each channel."""
        base = self.base
        if base is None:
            raise EditError("the term has no image to go on from; shade it first")
        mixed = base.image.copy() if from_base else np.zeros_like(self.image)
        for image, gain in parts:
            mixed += np.array(gain, np.float32)[:, None] * image
        self.show(Shaded(mixed), self.target)
        self.is_near = from_base and base.is_near

    def can_follow(self) -> bool:
        """Whether all that the image lacks is a change of light."""
        base = self.base
        return base is not None and self.effective is None and not self._differing(base.bands)

    def follow(self, light: Hashable, add_change: Callable[[F32], None]) -> None:
        """Show the base and what has changed since in this light, which `add_change` adds to an image in place."""
        if self.base is None:
            raise EditError("the term has no image to go on from; shade it first")
        self.image[:] = self.base.image
        add_change(self.image)
        self.followed, self.is_glimpse = light, True
        self._show_in(light)

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

    @property
    def fidelity(self) -> Fidelity:
        """How near what the picture shows of it is to its look."""
        if self.front is not None:
            return self.front.fidelity
        if self.lit is None or (self.is_glimpse and self.followed is None):
            return "preview"
        if self.is_glimpse:
            return "followed" if self.followed == self._light else "approximate"
        if self.differing():
            return "approximate"
        return "near" if self.is_near else "exact"

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
        self._show_in(self._light)
        return min(moved, budget)

    def _sum(self, frozen: Frozen, active: Along) -> int:
        """Make the image anew from all coefficients of the target; returns their number."""
        self.shown = active.coefficients(self.target)
        self.image[:] = 0
        stream(frozen.transport, columns_of(self.shown), self.image)
        self.is_near, self.is_glimpse = not active.is_complete, False
        self.base = self.followed = None
        self._show_in(self._light)
        return self.shown.size
