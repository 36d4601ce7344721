"""The look of a session: where its edits are applied, checked and counted."""

from __future__ import annotations

from typing import Any

from relume import look as looks
from relume.errors import EditError
from server.live.painter import Target
from server.protocol import EditMessage


class LookDesk:
    """The newest accepted look and its revision."""

    def __init__(self, default: dict[str, Any], document: dict[str, Any], revision: int) -> None:
        self.default, self.document, self.revision = default, document, revision

    def target(self, received_s: float | None = None) -> Target:
        """The look as something to show."""
        return Target(looks.validate(self.document, self.default), self.document, self.revision, received_s)

    def apply(self, message: EditMessage, received_s: float) -> Target:
        """Apply an edit that came at `received_s`, whole or not at all.

        Raises:
            EditError, ParameterError: the look stays as it was.
        """
        if message.revision <= self.revision:
            raise EditError(f"old revision: {message.revision} is not newer than {self.revision}; count on from there")
        patch = [operation.model_dump(exclude_unset=True) for operation in message.patch]
        document = looks.apply_patch(self.document, patch, self.default)
        look = looks.Look.model_validate(document)
        self.document, self.revision = document, message.revision
        return Target(look, document, message.revision, received_s)

    def revert(self, shown: Target) -> None:
        """Go back to the look that is shown; the revision stays, so that the client counts on."""
        self.document = shown.document
