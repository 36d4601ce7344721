"""How a picture keeps up with light that changes while a hand moves: mixed where only gains change, which is exact;
followed where rows can, else glimpsed.

The latter two are rough and never called exact; at rest every term is shaded in the light as it is then. Whichever way
it goes, all terms go together: none is brought to a light in which another one cannot be shown.
"""

from __future__ import annotations

from typing import Any

from relume.look import Look
from relume.transfer.following import Follower, RowsNeed
from relume.transfer.glimpse import Glimpse, can_glimpse, helps_to_open, is_prepared
from relume.transfer.light import Light
from relume.transfer.mixing import Mixer
from relume.transfer.need import Need
from relume.transfer.pointer import ROTATION, ColorPointer, LightPointer, Pointer, TransportPointer
from relume.transfer.view_images import ViewImages


class LightMode:
    """Of one view."""

    def __init__(self, images: ViewImages) -> None:
        self._images, self._follower, self._mixer = images, Follower(images), Mixer(images)
        self._is_turning = self._lacks_glimpse = self._is_preview = False
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

    def preview(self) -> None:
        """The picture shows nothing yet: glimpse it first, where making its images would take long."""
        self._is_preview = self._lacks_glimpse = helps_to_open(self._images)

    def follow_look(self, before: Light, look: Look) -> None:
        """The images have a new look. before: the light until now."""
        images = self._images
        self._hold_light(look)
        self._follower.follow_look(before)
        if images.light != before:
            was_shown = not all(image.is_blank for _, image in images.terms())
            is_wanted = (was_shown or self._lacks_glimpse) and can_glimpse(images)
            self._lacks_glimpse = is_wanted and not (self._follower.follows_all() or self._mixer.mixes_all())

    def next_need(self) -> RowsNeed | Glimpse | Need | None:
        """What must be made next for light to be followed or glimpsed."""
        rows = self._follower.next_need() if self._follower.is_awaited else None
        if rows is not None:
            return rows
        images = self._images
        if self._lacks_glimpse or (self._is_turning and can_glimpse(images) and not is_prepared(images)):
            # where the light is only about to change, samples of all are chosen ahead
            terms, is_ahead = images.terms(), not self._lacks_glimpse
            lacking = (found for found in terms if is_ahead or not self._follower.follows(*found))
            return Glimpse.of(images, lacking, "a preview" if self._is_preview else "the light")
        return self._mixer.next_need()

    def held_need(self) -> RowsNeed | Need | None:
        """What can be made ahead for what a hand is on, when nothing else is lacking."""
        return self._follower.next_need() or self._mixer.held_need()

    def adopt(self, need: RowsNeed | Glimpse, made: Any) -> None:
        """Show what a need has made."""
        if isinstance(need, Glimpse):
            need.adopt(made)
            self._is_preview = False
            self._lacks_glimpse = self._lacks_glimpse and need.light != self._images.light

    def step(self) -> None:
        """Bring all terms that can be mixed or followed to the light as it is now, if all others are in it.

        Else those that can be followed are brought to the light of a glimpse, which may be an earlier one.
        """
        images = self._images
        unlit = [(m, t) for m, t in images.terms() if t.effective is None and not t.is_blank]
        late = [(m, t) for m, t in unlit if t.lit != images.light]
        if all(self._mixer.mixes(m, t) or self._follower.follows(m, t) for m, t in late):
            self._mixer.step()
            self._follower.step(images.light)
            return
        rough = next((t.lit for _, t in unlit if t.lit is not None and t.followed is None), None)
        if isinstance(rough, Light):
            self._follower.step(rough)
