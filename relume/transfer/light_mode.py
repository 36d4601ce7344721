"""How a picture keeps up with light that changes while a hand moves: mixed where only gains change, which is exact;
followed where rows can, else glimpsed.

The latter two are rough and never called exact; at rest every term is shaded in the light as it is then.
"""

from __future__ import annotations

from typing import Any

from relume.look import Look
from relume.transfer.following import Follower, RowsNeed
from relume.transfer.glimpse import Glimpse, can_glimpse, is_prepared
from relume.transfer.light import Light
from relume.transfer.mixing import Mixer
from relume.transfer.need import Need
from relume.transfer.pointer import ROTATION, ColorPointer, LightPointer, Pointer, TransportPointer
from relume.transfer.view_images import ViewImages


class LightMode:
    """Of one view."""

    def __init__(self, images: ViewImages) -> None:
        self._images, self._follower, self._mixer = images, Follower(images), Mixer(images)
        self._is_turning = self._lacks_glimpse = False
        self._held: str | None = None

    def hold(self, pointer: Pointer, look: Look) -> None:
        """A hand takes hold of something that may change the light. look: as it is now."""
        self._held = pointer.name if isinstance(pointer, LightPointer) else None
        self._hold_light(look)
        self._is_turning = pointer == ROTATION
        if isinstance(pointer, ColorPointer | LightPointer | TransportPointer):
            self._follower.prepare()

    def _hold_light(self, look: Look) -> None:
        held = None if self._held is None else look.lights.get(self._held)
        self._mixer.hold(None if held is None else held.geometry)

    def follow_look(self, before: Light, look: Look, *, was_shown: bool) -> None:
        """The images have a new look.

        Args:
            before: the light until now. was_shown: whether the picture showed anything then.
        """
        images = self._images
        self._hold_light(look)
        self._follower.follow_look(before)
        if images.light != before:
            is_wanted = (was_shown or self._lacks_glimpse) and can_glimpse(images)
            self._lacks_glimpse = is_wanted and not (self._follower.follows_all() or self._mixer.mixes_all())

    def next_need(self) -> RowsNeed | Glimpse | Need | None:
        """What must be made next for light to be followed or glimpsed."""
        rows = self._follower.next_need() if self._follower.is_awaited else None
        if rows is not None:
            return rows
        images = self._images
        if self._lacks_glimpse or (self._is_turning and can_glimpse(images) and not is_prepared(images)):
            return Glimpse.of(images)
        return self._mixer.next_need()

    def held_need(self) -> RowsNeed | Need | None:
        """What can be made ahead for what a hand is on, when nothing else is lacking."""
        return self._follower.next_need() or self._mixer.held_need()

    def adopt(self, need: RowsNeed | Glimpse, made: Any) -> None:
        """Show what a need has made."""
        if isinstance(need, Glimpse):
            need.adopt(made)
            self._lacks_glimpse = self._lacks_glimpse and need.light != self._images.light

    def step(self) -> None:
        """Bring all terms that can be mixed or followed to the light as it is now."""
        self._mixer.step()
        self._follower.step()
