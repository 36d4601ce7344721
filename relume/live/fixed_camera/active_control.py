"""The control that the user operates: sent by the client with each edit, and when a drag begins."""

from __future__ import annotations

from typing import NamedTuple

from relume.live.fixed_camera.edit_pointers import ROTATION, ColorPointer, LightPointer, Pointer, TransportPointer
from relume.live.fixed_camera.live_term import LiveTerm
from relume.live.fixed_camera.view_images import TermTarget
from relume.look import LightGeometry, Look
from relume.operators.edit_basis import EditBasis


class HeldControl(NamedTuple):
    """A curve or a parameter that the user edits.

    Attributes:
        basis: the free coefficients of the edit; None if no operator depends on it.
    """

    target: TermTarget
    basis: EditBasis | None


class ActiveControl(NamedTuple):
    """The active control in the current look.

    Attributes:
        prepared_control: the curve that the user opened, or the parameter that was prepared last.
        edited_control: the curve or the parameter that the last edit changed.
        pointer: target of the last edit, or of a later prepare message.
    """

    prepared_control: HeldControl | None = None
    edited_control: HeldControl | None = None
    pointer: Pointer | None = None

    def edit_basis(self, live: LiveTerm, curves: set[str]) -> EditBasis | None:
        """Return the basis of the active edit of a term: one that covers all changed curves if there is one."""
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
        """True if it changes the light from local lights or surfaces: a light, a color, the number of bounces."""
        return isinstance(self.pointer, ColorPointer | LightPointer | TransportPointer)

    @property
    def rotates_environment(self) -> bool:
        """True if it rotates the environment."""
        return self.pointer == ROTATION

    def dragged_light(self, look: Look) -> LightGeometry | None:
        """Return the geometry of the local light that is dragged, as in a look; None if no light is."""
        light = look.lights.get(self.pointer.name) if isinstance(self.pointer, LightPointer) else None
        return None if light is None else light.geometry
