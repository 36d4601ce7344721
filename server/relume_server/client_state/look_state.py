"""Look of a session: applies, validates and counts its edits."""

from __future__ import annotations

import time
from typing import Any

from relume import look as looks
from relume.core.errors import EditError
from relume.look import Look, MaterialLook
from relume_server.client_state.pointers import check_active_pointer
from relume_server.client_state.target import Target
from relume_server.schemas.protocol import EditMessage


class LookState:
    """Newest accepted look, its revision, and solo lights (None: all)."""

    def __init__(
        self, default: dict[str, Any], document: dict[str, Any], revision: int, solo: frozenset[str] | None = None
    ) -> None:
        self.default, self.document, self.revision, self.solo = default, document, revision, solo
        self._materials: dict[str, tuple[Any, MaterialLook]] = {}

    def target(self, shared: int = 0) -> Target:
        """Return the look as a target; `shared` is its `room_revision`."""
        return Target(
            self._read(self.document), self.document, self.revision, None, solo=self.solo, room_revision=shared
        )

    def apply(self, message: EditMessage, received_s: float) -> Target:
        """Apply an edit received at `received_s`, completely or not at all.

        Raises:
            EditError, ParameterError: the look is unchanged.
        """
        if message.revision <= self.revision:
            raise EditError(f"revision {message.revision} is not newer than {self.revision}; send a larger one")
        patch = [operation.model_dump(exclude_unset=True) for operation in message.patch]
        document = looks.apply_patch(self.document, patch, self.default)
        if message.active_control is not None:
            check_active_pointer(message.active_control, document)
        look = self._read(document)
        self.document, self.revision = document, message.revision
        if message.changes_solo:
            self.solo = None if message.solo is None else frozenset(message.solo)
        applied_s = time.perf_counter()
        return Target(
            look, document, message.revision, received_s, message.active_control, self.solo, applied_s=applied_s
        )

    def adopt(self, document: dict[str, Any], source: Target) -> Target:
        """Take over the document of another participant's edit; the revision is unchanged."""
        self.document = document
        look = self._read(document)
        return Target(
            look,
            document,
            self.revision,
            source.received_s,
            source.active_pointer,
            self.solo,
            source.room_revision,
            source.applied_s,
        )

    def reverted(self, document: dict[str, Any], previous: Target) -> Target:
        """Target for this document with the solo lights of `previous`."""
        return Target(
            self._read(document),
            document,
            self.revision,
            None,
            solo=previous.solo,
            room_revision=previous.room_revision,
        )

    def revert(self, previous: Target) -> None:
        """Return to the displayed look; the revision stays, so that the client keeps counting."""
        self.document, self.solo = previous.document, previous.solo

    def _read(self, document: dict[str, Any]) -> Look:
        """Parse a complete document; long curves of unchanged materials are reused."""
        previous, self._materials = self._materials, {}
        for name, section in document["materials"].items():
            before, material = previous.get(name, (None, None))
            if material is None or before is not section:
                material = MaterialLook.model_validate(section)
            self._materials[name] = section, material
        materials = {name: material for name, (_, material) in self._materials.items()}
        return Look.model_validate({**document, "materials": materials})
