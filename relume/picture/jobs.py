"""What a picture needs made before it can go on: found by looking, made in any thread, installed by the picture's user.

All that `make` reads was fixed when the job was found: the picture may be changed while it runs, and `install` looks
whether what was made is still wanted.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.look.model import Rgb
from relume.operators.edit_basis import EditBasis
from relume.operators.frozen import Frozen, Rough
from relume.operators.operator import Operator
from relume.operators.packed import Packed
from relume.operators.shade import Begun, Shaded, shaded_bytes
from relume.picture.arrivals import keep_arrived, may_be_kept
from relume.picture.fidelity import Fidelity
from relume.picture.light import Light, parts_of
from relume.picture.live_term import LiveTerm
from relume.picture.material_image import MaterialImage
from relume.picture.shown import Shown
from relume.picture.thinning import Form, freeze_some
from relume.picture.view_images import ROUGHLY, ViewImages
from relume.project.receivers import Receivers

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
_BEGUN = "begun"  # ends the names of images of which some is shaded
Progress = Callable[[float], None]
Cancelled = Callable[[], bool]


class Job(Protocol):
    """Something to be made.

    Attributes:
        what: in words. key: equal keys are the same job.
        state: what making it is called; what follows a hand takes a few frames, and nobody is told of it.
        refines: the picture is near its look without it, so that it can wait until the hand rests.
        goes_on: what is made of it is kept where it is cancelled.
    """

    @property
    def what(self) -> str: ...
    @property
    def state(self) -> Literal["freezing", "shading", "following"]: ...
    @property
    def key(self) -> tuple[Hashable, ...]: ...
    @property
    def refines(self) -> bool: ...
    @property
    def goes_on(self) -> bool: ...
    def make(self, progress: Progress, cancelled: Cancelled) -> Any:
        """Make it, unless the memory has it; a `NotMadeError` where what is shown can stay. Raises CancelledError where
        `cancelled`, asked now and then, said so."""
        ...

    def install(self, made: Any) -> None:
        """Go on with what `make` returned, unless the look has moved on to where it is of no use."""
        ...


class Part(NamedTuple):
    """Of a light. key: of the image in it alone. gain: how much of it there is, of each channel."""

    key: tuple[Hashable, ...]
    light: Light
    gain: Rgb


class Place(NamedTuple):
    """A term of a picture: where it is, and the one that was there when a job was found."""

    images: ViewImages
    material: MaterialImage
    live: LiveTerm

    @property
    def name(self) -> str:
        """The material's."""
        return self.images.transfer.material_names[self.material.index]

    def is_there(self) -> bool:
        """Whether the look still has this term."""
        return any(self.live is known for known in self.material.terms)


@dataclass(frozen=True, eq=False)
class Freeze:
    """The operator of a term along what an edit moves, everything else dormant (eq. 22, Ben-Artzi 2006).

    Attributes:
        bands: of the term's curves, (3, J) each. light: what arrives.
        form: what it is made of.
    """

    place: Place
    basis: EditBasis
    key: tuple[Hashable, ...]
    term: Term
    bands: Mapping[str, F64]
    light: Light
    form: Form
    refines: bool
    state: Literal["freezing", "shading"] = "freezing"
    goes_on = False

    @classmethod
    def of(cls, place: Place, basis: EditBasis, form: Form) -> Freeze:
        """The operator for what is wanted of a term now.

        Args:
            place: of the term. basis: what is free in it. form: from `form_for`.
        """
        images, material, live = place
        key = images.key_of_operator(material, live, basis, live.target, is_rough=form.is_rough)
        is_seen = live.is_seen()
        return cls(place, basis, key, live.term, live.target, live.light, form, is_seen)

    @property
    def what(self) -> str:
        """In words."""
        return f"{self.place.name}, {self.basis.label}"

    @property
    def num_bytes(self) -> int:
        """Memory to keep it."""
        return self.form.num_bytes(self.place.material, self.basis.num_columns)

    def make(self, progress: Progress, cancelled: Cancelled) -> Operator:
        """See `Job`."""
        images, material, _ = self.place

        def frozen() -> Operator:
            lights, receivers = images.arriving(material, self.light, cancelled)

            def freeze(some: Receivers) -> Frozen | Packed:
                watched = progress, cancelled
                return self.basis.freeze(self.term, self.bands, lights, some, *watched, is_packed=self.form.is_packed)

            if self.form.is_rough:
                lights = images.transfer.merged(self.light)
                return Rough(**vars(freeze(receivers)))
            if self.form.step == 1:
                return freeze(receivers)
            return freeze_some(images.view, material.index, self.form.step, receivers, freeze)

        return images.cache.get(self.key, Operator, self.num_bytes, frozen)  # type: ignore[type-abstract]

    def install(self, made: Operator) -> None:
        """See `Job`; the dormant curves of the operator must be those that are wanted now.

        Where the image shows other curves, or the operator can say them better, it is summed anew. An operator that is
        not exact goes on from the image as it is, if that differs in nothing else.
        """
        images, material, live = self.place
        is_rough = self.form.is_rough
        if not is_rough:
            images.cache.forget((*self.key, ROUGHLY))
        wanted = images.key_of_operator(material, live, self.basis, live.target, is_rough=is_rough)
        if not self.place.is_there() or self.key != wanted:
            return
        ready, differing = live.ready, set(live.differing())
        is_known = live.is_firm and ready.basis == self.basis  # its coefficients hold, also where only some were moved
        if not made.is_exact and goes_on_from(ready, differing, self.basis):
            if not is_known:
                live.put(replace(ready, basis=self.basis, coefficients=self.basis.coefficients(ready.bands)))
            return
        if not made.is_whole:
            return
        says_better = ready.fidelity < Fidelity.EXACT and self.basis.is_complete
        if not differing <= set(self.basis.moves) or (differing and not is_known) or says_better:
            live.put(ready.summed(made, self.basis, live.target, live.light))
        elif not is_known:
            live.put(replace(ready, basis=self.basis, coefficients=self.basis.coefficients(live.target)))


def goes_on_from(ready: Shown, differing: Collection[str], basis: EditBasis) -> bool:
    """Whether changes along a basis may be added to what is ready: its curves are known, and no other one differs.

    Args:
        ready: of a term. differing: curves whose target is not summed in it. basis: of an operator.
    """
    is_known = all(not np.isnan(ready.bands.get(name, np.nan)).any() for name in basis.moves)
    return ready.is_firm and is_known and set(differing) <= set(basis.moves)


@dataclass(frozen=True, eq=False)
class Shade:
    """The image of a term's target in some light, from nothing: what every route to EXACT must agree with.

    Attributes:
        model: of the term. bands: of its curves, (3, J) each. parts: that the light is the sum of.
        is_default: the look is the scene's own, whose images stay beside the store.
    """

    place: Place
    key: tuple[Hashable, ...]
    term: Term
    model: Hashable
    bands: Mapping[str, F64]
    light: Light
    parts: Sequence[Part]
    is_default: bool
    refines: bool
    state: Literal["freezing", "shading"] = "shading"
    goes_on = True

    @classmethod
    def of(cls, place: Place, light: Light, *, refines: bool | None = None) -> Shade:
        """Of the term at a place, in some light. refines: whether it can wait; by itself where the term can be seen
        without it."""
        images, material, live = place
        key, waits = images.key_of_image(material, live, light), live.is_seen() if refines is None else refines
        parts = [Part(images.key_of_image(material, live, part), part, gain) for part, gain in parts_of(light).items()]
        is_default = images.is_default(material, live, light)
        return cls(place, key, live.term, live.model, live.target, light, parts, is_default, waits)

    @property
    def what(self) -> str:
        """In words."""
        return f"{self.place.name}, {self.term.label}"

    @property
    def num_bytes(self) -> int:
        """Memory to keep it."""
        return shaded_bytes(self.place.material.num_samples)

    def make(self, progress: Progress, cancelled: Cancelled) -> Shaded:
        """See `Job`; kept beside the store as well."""
        images = self.place.images
        kept = images.transfer.derived if self.is_default else images.transfer.edited
        shape = self.place.live.ready.image.shape

        def shaded() -> Shaded:
            return kept.get(self.key[1:], shape, lambda: self._summed(progress, cancelled))

        return images.cache.get(self.key, Shaded, self.num_bytes, shaded)

    def _summed(self, progress: Progress, cancelled: Cancelled) -> Shaded:
        """Shade the parts of the light that no other image has had, and sum all."""
        images, material, live = self.place
        texels = self.term.texels
        if texels is not None and self.light == live.light and may_be_kept(images, material, texels):
            arrived = keep_arrived(images, material, texels, self.light, progress, cancelled)
            return arrived.sent(texels, images.unlit(material))
        if len(self.parts) < 2:
            return self._finished(self.key, self.light, progress, cancelled)
        found: list[tuple[F32, Rgb]] = []
        for done, (key, light, gain) in enumerate(self.parts):
            make = partial(self._finished, key, light, partial(self._tell, progress, done), cancelled)
            found.append((images.cache.get(key, Shaded, self.num_bytes, make).image, gain))
        return Shaded(weighted_sum(np.zeros_like(live.ready.image), found))

    def _finished(self, key: tuple[Hashable, ...], light: Light, progress: Progress, cancelled: Cancelled) -> Shaded:
        """The image in a light, from what was begun of it."""
        shaded = Shaded.of(self._begun(key, light, progress, cancelled, None))
        self.place.images.cache.forget((*key, _BEGUN))
        return shaded

    def _begun(
        self,
        key: tuple[Hashable, ...],
        light: Light,
        progress: Progress,
        cancelled: Cancelled,
        wanted: NDArray[np.bool_] | None,
    ) -> F32:
        """Rows of the image in a light, those of wanted samples shaded; None: all. (n, 3)"""
        images, material, _ = self.place
        num, passing = material.num_samples, images.cache.passing
        begun = passing.get((*key, _BEGUN), Begun, self.num_bytes, lambda: Begun.of(num))
        begun.shade(self.term, self.bands, *images.arriving(material, light, cancelled), progress, cancelled, wanted)
        return begun.rows

    def _tell(self, progress: Progress, done: int, share: float) -> None:
        """How much of all parts of the light is done with a share of one."""
        progress((done + share) / max(1, len(self.parts)))

    def some(self, wanted: NDArray[np.bool_], progress: Progress, cancelled: Cancelled) -> F32:
        """Rows of the same image of which only wanted samples are made; others may be anything. (n, 3)

        Args:
            wanted: samples of the material. (n,) progress, cancelled: as of `make`; what is made is kept.
        """
        if len(self.parts) < 2:
            return self._begun(self.key, self.light, progress, cancelled, wanted)
        total, num = np.zeros((len(wanted), 3), np.float32), len(wanted)
        for done, (key, light, gain) in enumerate(self.parts):
            known = self.place.images.cache.find(key, Shaded)
            tell = partial(self._tell, progress, done)
            rows = self._begun(key, light, tell, cancelled, wanted) if known is None else known.rows(num)
            total += np.array(gain, np.float32) * rows
        return total

    def install(self, made: Shaded) -> None:
        """See `Job`; an image of older curves is shown where there is none: a hand may not rest for long."""
        images, material, live = self.place
        if not self.place.is_there() or (live.model, live.light) != (self.model, self.light):
            return
        is_current = self.key == images.key_of_image(material, live, self.light)
        if not live.is_firm or (is_current and (not live.is_exact() or live.ready.rounding > 0)):
            basis = live.ready.basis  # a hand that is on something goes on from here
            coefficients = None if basis is None else basis.coefficients(self.bands)
            live.put(Shown(made.image.copy(), Fidelity.EXACT, self.bands, self.light, basis, coefficients))


@dataclass(frozen=True, eq=False)
class Settle:
    """An image that was summed from steps, summed once: at rest, exact is a fact.

    Attributes:
        ready: the state that the steps led to. sum_into: writes the same image, summed once, over zeros.
        rounding: that such a sum leaves, see `Shown`.
    """

    place: Place
    key: tuple[Hashable, ...]
    ready: Shown = field(repr=False)
    sum_into: Callable[[F32], object] = field(repr=False)
    rounding: float = 0.0
    refines: bool = True
    state: Literal["freezing", "shading"] = "shading"
    goes_on = False

    @property
    def what(self) -> str:
        """In words."""
        return f"{self.place.name}, {self.place.live.term.label}"

    def make(self, progress: Progress, cancelled: Cancelled) -> F32:
        """See `Job`; takes as long as reading once what is summed."""
        image = np.zeros_like(self.ready.image)
        self.sum_into(image)
        progress(1.0)
        return image

    def install(self, made: F32) -> None:
        """See `Job`; of no use where another step has been added."""
        live = self.place.live
        if live.ready is self.ready:
            live.put(replace(self.ready, image=made, rounding=self.rounding, fidelity=Fidelity.EXACT))


def weighted_sum(start: F32, parts: Sequence[tuple[F32, Rgb]]) -> F32:
    """Σ g R, added to an image in place: transport is linear in light.

    Args:
        start: (tiles, 3, samples) float32, written. parts: images of the same shape, and the gain of each channel.
    """
    for image, gain in parts:
        start += np.array(gain, np.float32)[:, None] * image
    return start
