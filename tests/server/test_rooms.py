"""Several people on one look: what one edits the others see, each in their own picture."""

from __future__ import annotations

import numpy as np
import pytest
from fastapi.testclient import TestClient
from session_client import IOR, SIGMA, Baked, Session, open_session

ROOM = "?room=together"


def param(name: str) -> str:
    return f"/materials/Paper/terms/1/params/{name}"


def shared_with(session: Session, path: str) -> dict[str, object]:
    """Wait for the message that tells of a path."""
    while True:
        message = session.text("shared")
        for operation in message["patch"]:
            if operation["path"] == path:
                return {**message, "value": operation["value"]}


def pixel(session: Session, revision: int, value: int) -> None:
    """Wait for an exact picture of that value."""
    while np.frombuffer(session.exact(revision).payload, "<u4")[0] != value:
        pass


def test_an_edit_of_one_is_in_the_picture_of_the_other(client: TestClient, baked: Baked) -> None:
    with (
        open_session(client, baked.bake, query=ROOM) as ann,
        open_session(client, baked.bake, query=ROOM) as bob,
        open_session(client, baked.bake) as alone,
    ):
        assert ann.text("hello")["room"]["created"]
        assert not bob.text("hello")["room"]["created"]
        assert alone.text("hello")["room"] is None
        bob.exact(0)
        ann.edit(1, SIGMA, 0.31)
        told = shared_with(bob, SIGMA)
        assert (told["revision"], told["by"], told["value"]) == (0, [1], 0.31)
        pixel(bob, 0, 810)
        assert ann.text("shared") == {"type": "shared", "revision": 1, "patch": [], "by": [1]}
        bob.edit(1, IOR, 1.7)
        assert shared_with(ann, IOR)["revision"] == 1
