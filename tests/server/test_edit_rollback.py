"""Edits in a room that the author's picture cannot show: only these are undone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from typing import Any

import jsonpatch
import numpy as np
import pytest
from fastapi.testclient import TestClient
from server_fakes import Control
from session_client import IOR, ROOM_FIELDS, SIGMA, Baked, Frame, Session, open_session

from relume_server.collaboration.join import derive_view_token
from relume_server.settings import Settings

WATCH = {"view_token": derive_view_token(ROOM_FIELDS["room"])}
EXPOSURE, ROTATION = "/display/exposure", "/environment/rotation"  # the bake does not support rotation
COLOR = "/materials/Paper/terms/0/color"
EXTINCTION = "/materials/Paper/terms/1/params/extinction"


@pytest.fixture
def settings(settings: Settings) -> Settings:
    settings.max_sessions = 8
    return settings


def joined(client: TestClient, baked: Baked) -> AbstractContextManager[Session]:
    """A session in the room."""
    return open_session(client, baked.bake, opening=ROOM_FIELDS)


class Client:
    """An editor's look: the server's updates, and its own edits that the server has not rejected."""

    def __init__(self, session: Session) -> None:
        self.session, self._revision = session, 0
        self.look: dict[str, Any] = session.text("hello")["look"]
        self._sent: dict[int, list[dict[str, Any]]] = {}

    def edit(self, path: str, value: Any, op: str = "replace") -> None:
        self._revision += 1
        self._sent[self._revision] = [{"op": op, "path": path, "value": value}]
        self.session.edit(self._revision, path, value, op=op)

    def hear(self, kind: str) -> dict[str, Any]:
        """Process messages up to the next one of a kind."""
        while True:
            message = self._next()
            if isinstance(message, dict) and message["type"] == kind:
                return message

    def exact(self, revision: int) -> None:
        """Process messages up to the exact picture of a revision."""
        while True:
            message = self._next()
            if isinstance(message, Frame) and message.header["exact"] and message.header["revision"] == revision:
                return

    def _next(self) -> dict[str, Any] | Frame:
        message = self.session.receive()
        if isinstance(message, dict) and message["type"] == "problem":
            self._sent.pop(message["revision"], None)
        elif isinstance(message, dict) and message["type"] == "room_update":
            own = [self._sent.pop(each) for each in sorted(self._sent) if each <= message["revision"]]
            for patch in [*own, message["patch"]]:
                jsonpatch.apply_patch(self.look, patch, in_place=True)
        return message

    def synchronize(self) -> None:
        """Process all messages so far."""
        self.session.send_message(type="ping")
        self.hear("pong")

    @property
    def is_confirmed(self) -> bool:
        return not self._sent

    def has(self, look: dict[str, Any]) -> bool:
        """True if the look equals this one, except for display settings."""
        return all(self.look[name] == look[name] for name in ("materials", "environment", "lights"))

    def wait_for_look(self, look: dict[str, Any]) -> None:
        """Process messages until the look equals this one."""
        while not self.has(look):
            self.hear("room_update")


@contextmanager
def rendering_paused(client: TestClient) -> Iterator[None]:
    """No picture is rendered meanwhile."""
    turns = client.app.state.services.threads.short_slots  # type: ignore[attr-defined]
    assert client.portal is not None
    while not turns.locked():
        client.portal.call(turns.acquire)
    yield
    client.portal.call(turns.release)


def rooms_look(client: TestClient, baked: Baked) -> dict[str, Any]:
    with joined(client, baked) as late:
        look: dict[str, Any] = late.text("hello")["look"]
        return look


def params(look: dict[str, Any]) -> dict[str, float]:
    values: dict[str, float] = look["materials"]["Paper"]["terms"][1]["params"]
    return values


def switch_to_unsupported_view(session: Session, control: Control) -> None:
    session.text("hello")
    session.send_message(type="view", name="left")
    while session.exact(0).header["view"] != "left":
        pass
    control.views_over_budget.add("left")


def assert_one_problem(session: Session) -> None:
    """Assert exactly one message that another participant's edit cannot be shown here."""
    assert session.text("problem")["revision"] is None
    session.send_message(type="ping")
    while (message := session.receive()) != {"type": "pong"}:
        assert not isinstance(message, dict) or message["type"] != "problem"


@pytest.mark.parametrize("opening", [ROOM_FIELDS, WATCH])
def test_failed_edit_does_not_undo_edits_of_others(
    client: TestClient, baked: Baked, control: Control, opening: dict[str, str]
) -> None:
    control.freeze_gate.set()
    with ExitStack() as stack:
        ann = Client(stack.enter_context(joined(client, baked)))  # viewers need an existing room
        vera = stack.enter_context(open_session(client, baked.bake, opening=opening))
        switch_to_unsupported_view(vera, control)
        ann.edit(IOR, 1.7)
        ann.exact(1)
        assert_one_problem(vera)
        for revision in (1, 2):
            vera.edit(revision, EXPOSURE, float(revision))
            assert_one_problem(vera)
        ann.edit(SIGMA, 0.31)
        ann.exact(2)
        look = rooms_look(client, baked)
        assert (params(look)["ior"], params(look)["sigma"]) == (1.7, 0.31)
        ann.wait_for_look(look)


def test_editor_whose_bake_cannot_show_an_edit_continues(client: TestClient, baked: Baked, control: Control) -> None:
    control.freeze_gate.set()
    with joined(client, baked) as first, joined(client, baked) as bob:
        ann = Client(first)
        switch_to_unsupported_view(bob, control)
        ann.edit(IOR, 1.7)
        assert_one_problem(bob)
        bob.edit(1, SIGMA, 0.31)
        assert_one_problem(bob)
        look = rooms_look(client, baked)
        assert (params(look)["ior"], params(look)["sigma"]) == (1.7, 0.31)
        ann.wait_for_look(look)


def test_only_failed_edits_of_a_batch_are_undone_for_all(client: TestClient, baked: Baked) -> None:
    with joined(client, baked) as first, joined(client, baked) as second:
        ann, bob = Client(first), Client(second)
        first.exact(0)
        second.exact(0)
        with rendering_paused(client):
            bob.edit(SIGMA, 0.31)
            bob.synchronize()
            ann.edit(EXTINCTION, 1.7)
            ann.synchronize()
            bob.edit(ROTATION, 30.0)
            bob.synchronize()
        assert bob.hear("problem")["revision"] == 2
        look = rooms_look(client, baked)
        assert (params(look)["sigma"], params(look)["extinction"]) == (0.2, 1.7)
        assert look["environment"]["rotation"] == 0.0
        for person in (ann, bob):
            person.wait_for_look(look)


def test_edits_on_top_of_an_undone_edit_are_undone(client: TestClient, baked: Baked) -> None:
    light = {"kind": "point", "position": [0.0, 1.0, 0.0]}
    with joined(client, baked) as first, joined(client, baked) as second:
        ann, bob = Client(first), Client(second)
        first.exact(0)
        second.exact(0)
        with rendering_paused(client):
            bob.edit("/lights/Lamp", light, op="add")
            bob.edit(ROTATION, 30.0)
            bob.synchronize()
            ann.hear("room_update")
            ann.edit("/lights/Lamp/intensity", 3.0)
            ann.edit(SIGMA, 0.31)
            ann.synchronize()
        while bob.hear("problem")["revision"] is None:
            pass
        look = rooms_look(client, baked)
        assert (look["lights"], params(look)["sigma"]) == ({}, 0.31)
        for person in (ann, bob):
            person.wait_for_look(look)


def test_display_settings_of_a_failed_batch_go_to_their_owner(client: TestClient, baked: Baked) -> None:
    with joined(client, baked) as session:
        bob = Client(session)
        session.exact(0)
        with rendering_paused(client):
            bob.edit(EXPOSURE, 2.0)
            bob.edit(ROTATION, 30.0)
            bob.synchronize()
        assert bob.hear("problem")["revision"] == 2
        bob.edit(SIGMA, 0.31)
        while not bob.is_confirmed:
            bob.hear("room_update")
        assert bob.look["display"]["exposure"] == 0.0


def test_failed_and_other_edits_converge_to_one_look(client: TestClient, baked: Baked) -> None:
    rng = np.random.default_rng(7)
    with ExitStack() as stack:
        opened = [stack.enter_context(joined(client, baked)) for _ in range(3)]
        people = [Client(session) for session in opened]
        for _ in range(80):
            person = people[rng.integers(3)]
            path = (SIGMA, EXTINCTION, COLOR, ROTATION)[rng.choice(4, p=[0.35, 0.35, 0.2, 0.1])]
            value = round(float(rng.uniform(0.2, 0.4)), 3)
            person.edit(path, [value] * 3 if path == COLOR else value)
            if rng.random() < 0.3:
                person.synchronize()
        for person in people:
            while not person.is_confirmed:
                person.synchronize()
            while not person.has(rooms_look(client, baked)):  # the current look may be undone next
                person.synchronize()
