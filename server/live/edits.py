"""The look of a session: where its edits are applied, checked and counted."""

from __future__ import annotations

from typing import Any

from relume import look as looks
from relume.errors import EditError
from relume.look import Look, MaterialLook
from server.live.painter import Target
from server.protocol import EditMessage


class LookDesk:
    """The newest accepted look and its revision."""

    def __init__(self, default: dict[str, Any], document: dict[str, Any], revision: int) -> None:
        self.default, self.document, self.revision = default, document, revision
        self._materials: dict[str, tuple[Any, MaterialLook]] = {}

    def target(self) -> Target:
        """The look as something to show."""
        return Target(self._read(self.document), self.document, self.revision, None)

    def apply(self, message: EditMessage, received_s: float) -> Target:
        """Apply an edit that came at `received_s`, whole or not at all.

        Raises:
            EditError, ParameterError: the look stays as it was.
        """
        if message.revision <= self.revision:
            raise EditError(f"old revision: {message.revision} is not newer than {self.revision}; count on from there")
        patch = [operation.model_dump(exclude_unset=True) for operation in message.patch]
        document = looks.apply_patch(self.document, patch, self.default)
        look = self._read(document)
        self.document, self.revision = document, message.revision
        return Target(look, document, message.revision, received_s)

    def revert(self, shown: Target) -> None:
        """Go back to the look that is shown; the revision stays, so that the client counts on."""
        self.document = shown.document

    def _read(self, document: dict[str, Any]) -> Look:
        """A complete document as a look; long curves of materials that did not change are not read again."""
        known, self._materials = self._materials, {}
        for name, part in document["materials"].items():
            before, material = known.get(name, (None, None))
            if material is None or before is not part:
                material = MaterialLook.model_validate(part)
            self._materials[name] = part, material
        materials = {name: material for name, (_, material) in self._materials.items()}
        return Look.model_validate({**document, "materials": materials})
