"""What the user's hand is on: said by the client with every edit, and when something is taken hold of before one."""

from __future__ import annotations

from typing import NamedTuple

from relume.look import LightGeometry, Look
from relume.operators.edit_basis import EditBasis
from relume.picture.jobs import Place
from relume.picture.live_term import LiveTerm
from relume.picture.pointer import ROTATION, ColorPointer, LightPointer, Pointer, TransportPointer


class Held(NamedTuple):
    """A curve or a parameter in hand.

    Attributes:
        basis: what must be free for it to be moved; None where light has no part in it.
    """

    place: Place
    basis: EditBasis | None


class Hand(NamedTuple):
    """A hand in the look as it is now.

    Attributes:
        touched: the curve that the user has opened, or the parameter that was taken hold of last.
        moved: the curve or the parameter that the last edit moved.
        pointer: what the last edit was of, or what was taken hold of since.
    """

    touched: Held | None = None
    moved: Held | None = None
    pointer: Pointer | None = None

    def basis_of(self, live: LiveTerm, curves: set[str]) -> EditBasis | None:
        """What the hand moves where such curves of a term change: all of them together, else what is touched."""
        found = [held.basis for held in (self.moved, self.touched) if held is not None and held.place.live is live]
        able = [basis for basis in found if basis is not None and not curves.isdisjoint(basis.moves)]
        return next((basis for basis in able if curves <= set(basis.moves)), able[-1] if able else None)

    @property
    def moves_light(self) -> bool:
        """Whether it is on what local lights or surfaces send out: a light, a colour, the bounces."""
        return isinstance(self.pointer, ColorPointer | LightPointer | TransportPointer)

    @property
    def is_turning(self) -> bool:
        """Whether it is on the environment's rotation."""
        return self.pointer == ROTATION

    def held_light(self, look: Look) -> LightGeometry | None:
        """The geometry of the local light that it is on, as that is in a look."""
        light = look.lights.get(self.pointer.name) if isinstance(self.pointer, LightPointer) else None
        return None if light is None else light.geometry
