"""What the user's hand is on: said by the client with every edit, and when something is taken hold of before one."""

from __future__ import annotations

from typing import NamedTuple

from relume.live.fixed_camera.edit_pointers import ROTATION, ColorPointer, LightPointer, Pointer, TransportPointer
from relume.live.fixed_camera.jobs import TermTarget
from relume.live.fixed_camera.live_term import LiveTerm
from relume.look import LightGeometry, Look
from relume.operators.edit_basis import EditBasis


class HeldControl(NamedTuple):
    """A curve or a parameter in hand.

    Attributes:
        basis: what must be free for it to be moved; None where light has no part in it.
    """

    target: TermTarget
    basis: EditBasis | None


class ActiveControl(NamedTuple):
    """A hand in the look as it is now.

    Attributes:
        prepared_control: the curve that the user has opened, or the parameter that was taken hold of last.
        edited_control: the curve or the parameter that the last edit moved.
        pointer: what the last edit was of, or what was taken hold of since.
    """

    prepared_control: HeldControl | None = None
    edited_control: HeldControl | None = None
    pointer: Pointer | None = None

    def edit_basis(self, live: LiveTerm, curves: set[str]) -> EditBasis | None:
        """What the hand moves where such curves of a term change: all of them together, else what is touched."""
        bases = [
            control.basis
            for control in (self.edited_control, self.prepared_control)
            if control is not None and control.target.live is live
        ]
        matching = [basis for basis in bases if basis is not None and not curves.isdisjoint(basis.affected_curves)]
        return next(
            (basis for basis in matching if curves <= set(basis.affected_curves)), matching[-1] if matching else None
        )

    @property
    def edits_light(self) -> bool:
        """Whether it is on what local lights or surfaces send out: a light, a colour, the bounces."""
        return isinstance(self.pointer, ColorPointer | LightPointer | TransportPointer)

    @property
    def rotates_environment(self) -> bool:
        """Whether it is on the environment's rotation."""
        return self.pointer == ROTATION

    def dragged_light(self, look: Look) -> LightGeometry | None:
        """The geometry of the local light that it is on, as that is in a look."""
        light = look.lights.get(self.pointer.name) if isinstance(self.pointer, LightPointer) else None
        return None if light is None else light.geometry
