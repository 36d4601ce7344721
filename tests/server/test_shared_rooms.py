"""Shared rooms: edits of one participant reach the pictures of all."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager, ExitStack
from typing import Any

import jsonpatch
import numpy as np
import pytest
from fastapi.testclient import TestClient
from session_client import IOR, ROOM_FIELDS, SIGMA, Baked, Session, open_session

from relume_server.collaboration.join import derive_view_token
from relume_server.settings import Settings

WATCH = {"view_token": derive_view_token(ROOM_FIELDS["room"])}
LOST = 1001
EXPOSURE = "/display/exposure"
EXTINCTION = "/materials/Paper/terms/1/params/extinction"


@pytest.fixture
def settings(settings: Settings) -> Settings:
    settings.max_sessions, settings.max_people, settings.max_rooms, settings.reconnect_seconds = 8, 3, 2, 0.05
    return settings


def joined(client: TestClient, baked: Baked) -> AbstractContextManager[Session]:
    """A session in the room."""
    return open_session(client, baked.bake, opening=ROOM_FIELDS)


def wait_for_update(session: Session, path: str) -> dict[str, Any]:
    """Wait for the update of a path."""
    while True:
        message = session.text("room_update")
        for operation in message["patch"]:
            if operation["path"] == path:
                return {**message, "value": operation["value"]}


def people(session: Session, done: Any) -> list[dict[str, Any]]:
    """Wait until the participants satisfy a condition."""
    while not done(participants := session.text("room")["people"]):
        pass
    return participants


def picture(session: Session, revision: int, value: int) -> int:
    """Wait for an exact picture with this value and return its room revision."""
    while value not in np.frombuffer((frame := session.exact(revision)).payload, "<u4")[:1]:
        pass
    return int(frame.header["room_revision"])


def refused(client: TestClient, baked: Baked, opening: Mapping[str, Any]) -> tuple[Any, ...]:
    with open_session(client, baked.bake, opening=opening) as session, pytest.raises(ConnectionError) as ended:
        session.receive()
    return ended.value.args


def test_edit_reaches_the_room_and_no_other_session(client: TestClient, baked: Baked) -> None:
    with ExitStack() as stack:
        contexts = joined(client, baked), joined(client, baked), open_session(client, baked.bake)
        opened = (stack.enter_context(each) for each in contexts)
        ann = next(opened)
        assert ann.text("hello")["room"]["is_new"]
        bob, alone = opened
        assert not bob.text("hello")["room"]["is_new"]
        assert alone.text("hello")["room"] is None
        ann.edit(1, SIGMA, 0.31)
        assert picture(bob, 0, 810) == 1
        assert ann.text("room_update") == {
            "type": "room_update",
            "revision": 1,
            "room_revision": 1,
            "patch": [],
            "edited_by": [1],
        }
        bob.edit(1, EXTINCTION, 1.7)
        assert wait_for_update(ann, EXTINCTION)["revision"] == 1
        alone.edit(1, EXTINCTION, 1.2)
        alone.exact(1)
        ann.edit(2, SIGMA, 0.4)
        news = wait_for_update(bob, SIGMA)
        assert (news["revision"], news["room_revision"], news["edited_by"], news["value"]) == (1, 3, [1], 0.4)
        with joined(client, baked) as late:
            hello = late.text("hello")
            params, own = (
                look["materials"]["Paper"]["terms"][1]["params"]
                for look in (hello["look"], hello["room"]["default_look"])
            )
            assert (params["sigma"], params["extinction"]) == (0.4, 1.7)
            assert (own["sigma"], own["extinction"]) == (0.2, 0.0)


def test_last_edit_of_a_path_wins_for_all(client: TestClient, baked: Baked) -> None:
    with joined(client, baked) as ann, joined(client, baked) as bob:
        ann.text("hello")
        bob.text("hello")
        for k in range(1, 21):
            ann.edit(k, SIGMA, 0.2 + k / 100)
            bob.edit(k, SIGMA, 0.6 + k / 100)
        has = [_sigma_after(session, own, 20) for session, own in ((ann, 0.2), (bob, 0.6))]
        with joined(client, baked) as late:
            last = late.text("hello")["look"]["materials"]["Paper"]["terms"][1]["params"]["sigma"]
            late.edit(1, EXTINCTION, 1.9)
            for k, session in enumerate((ann, bob)):
                patch: dict[str, float] = {}
                while EXTINCTION not in patch:
                    patch = {each["path"]: each["value"] for each in session.text("room_update")["patch"]}
                    has[k] = patch.get(SIGMA, has[k])
        assert last in (0.4, 0.8)
        assert has == [last, last]


def _sigma_after(session: Session, own: float, revision: int) -> float:
    """The client's value once all its edits, numbered from `own`, are confirmed in the room's look."""
    while True:
        message = session.text("room_update")
        sigma = next((each["value"] for each in message["patch"]), own + message["revision"] / 100)
        if message["revision"] == revision:
            return round(sigma, 6)


def test_exposure_is_per_participant_and_newcomers_start_with_the_last(client: TestClient, baked: Baked) -> None:
    with joined(client, baked) as ann, joined(client, baked) as bob:
        ann.text("hello")
        bob.text("hello")
        ann.edit(1, EXPOSURE, 2.0)
        ann.edit(2, SIGMA, 0.31)
        assert [each["path"] for each in wait_for_update(bob, SIGMA)["patch"]] == [SIGMA]
        with joined(client, baked) as late:
            assert late.text("hello")["look"]["display"]["exposure"] == 2.0


def test_participants_are_announced(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake, opening={**ROOM_FIELDS, "name": "Ann"}) as ann:
        (first,) = ann.text("hello")["room"]["people"]
        assert (first["name"], first["role"], first["online"], first["material"]) == ("Ann", "admin", True, None)
        with joined(client, baked) as bob:
            room = bob.text("hello")["room"]
            assert (room["self_id"], [each["name"] for each in room["people"]]) == (2, ["Ann", "Guest 2"])
            bob.send_message(type="presence", name="Bob", material="Paper")
            participants = people(ann, lambda them: them[-1]["name"] == "Bob")
            assert participants[1]["material"] == "Paper"
            assert participants[1]["color"] != participants[0]["color"]
            bob.send_message(type="presence", material="Nothing")
            assert "one of Paper" in bob.text("problem")["problem"]["detail"]
            bob.send_message(type="presence", name="\u202e\n")
            assert "printable" in bob.text("problem")["problem"]["detail"]
            bob.websocket.close(LOST)
        # one message may contain both
        participants = people(ann, lambda them: len(them) == 1 or not them[1]["online"])
        assert len(participants) == 1 or len(people(ann, lambda them: len(them) == 1)) == 1


def test_newcomers_are_announced_while_frames_wait(client: TestClient, baked: Baked) -> None:
    turns = client.app.state.services.threads.short_slots  # type: ignore[attr-defined]
    assert client.portal is not None
    with joined(client, baked) as ann:
        ann.exact(0)
        while not turns.locked():
            client.portal.call(turns.acquire)
        with joined(client, baked) as bob:
            bob.text("hello")
            assert [each["id"] for each in people(ann, lambda them: len(them) == 2)] == [1, 2]
            client.portal.call(turns.release)


def test_goodbye_removes_a_participant_immediately(client: TestClient, baked: Baked) -> None:
    with joined(client, baked) as ann:
        ann.text("hello")
        with joined(client, baked) as bob:
            participant_token = bob.text("hello")["room"]["participant_token"]
            with open_session(
                client, baked.bake, opening={**ROOM_FIELDS, "participant_token": participant_token}
            ) as finer:
                assert finer.text("hello")["room"]["self_id"] == 2
                bob.websocket.close(1000)
                finer.send_message(type="presence", name="Bob")
                participants = people(ann, lambda them: them[-1]["name"] == "Bob")
                assert [each["online"] for each in participants] == [True, True]
                finer.websocket.close(1000)
                while len(participants := ann.text("room")["people"]) == 2:
                    assert participants[1]["online"]


def test_presence_without_a_room_is_rejected(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        session.send_message(type="presence", name="Ann")
        assert "with a room" in session.text("problem")["problem"]["detail"]


class TestReconnect:
    @pytest.fixture
    def settings(self, settings: Settings) -> Settings:
        settings.reconnect_seconds, settings.max_people = 60.0, 2
        return settings

    def test_participant_and_room_survive_a_reconnect(self, client: TestClient, baked: Baked) -> None:
        with joined(client, baked) as ann:
            participant_token = ann.text("hello")["room"]["participant_token"]
            ann.send_message(type="presence", name="Ann")
            ann.edit(1, SIGMA, 0.31)
            ann.exact(1)
            ann.websocket.close(LOST)
        with open_session(client, baked.bake, opening={**ROOM_FIELDS, "participant_token": participant_token}) as again:
            hello = again.text("hello")
            assert (hello["room"]["self_id"], hello["room"]["is_new"], hello["revision"]) == (1, False, 0)
            assert [each["name"] for each in hello["room"]["people"]] == ["Ann"]
            assert hello["look"]["materials"]["Paper"]["terms"][1]["params"]["sigma"] == 0.31

    def test_resumed_session_has_its_exposure_and_the_current_look(self, client: TestClient, baked: Baked) -> None:
        with joined(client, baked) as ann, ExitStack() as stack:
            ann.text("hello")  # later participants get it in hello
            bob = stack.enter_context(joined(client, baked))
            hello = bob.text("hello")
            bob.edit(1, EXPOSURE, 1.0)
            bob.edit(2, SIGMA, 0.5)
            wait_for_update(ann, SIGMA)
            bob.websocket.close(LOST)
            stack.close()
            ann.edit(1, EXTINCTION, 1.9)
            ann.exact(1)
            opening = {
                **ROOM_FIELDS,
                "participant_token": hello["room"]["participant_token"],
                "resume": hello["resume"],
            }
            with open_session(client, baked.bake, opening=opening) as again:
                back = again.text("hello")
                params = back["look"]["materials"]["Paper"]["terms"][1]["params"]
                assert (back["resumed"], back["revision"], back["look"]["display"]["exposure"]) == (True, 2, 1.0)
                assert (params["sigma"], params["extinction"]) == (0.5, 1.9)

    def test_excess_participants_are_rejected(self, client: TestClient, baked: Baked) -> None:
        with joined(client, baked) as ann, joined(client, baked) as bob:
            ann.text("hello")
            bob.text("hello")
            code, reason = refused(client, baked, ROOM_FIELDS)
            assert (code, reason) == (1013, "2 people are in this room, which is its limit; wait until one leaves")


def test_viewers_follow_and_cannot_edit(client: TestClient, baked: Baked) -> None:
    assert refused(client, baked, WATCH)[0] == 1013
    with ExitStack() as stack:
        ann = stack.enter_context(joined(client, baked))
        assert ann.text("hello")["room"]["view_token"] == WATCH["view_token"]
        vera = stack.enter_context(open_session(client, baked.bake, opening=WATCH))
        hello = vera.text("hello")
        assert (hello["role"], hello["room"]["id"]) == ("view", None)
        assert ROOM_FIELDS["room"] not in str(hello)
        vera.exact(0)
        vera.edit(1, SIGMA, 0.9)
        problem = vera.text("problem")["problem"]
        assert (problem["status"], problem["detail"][:23]) == (403, "this link is view-only;")
        ann.edit(1, SIGMA, 0.31)
        picture(vera, 0, 810)
        assert people(ann, lambda them: len(them) == 2)[1]["role"] == "view"


def test_names_are_bounded(client: TestClient, baked: Baked) -> None:
    rooms = ("", "a" * 23, "a" * 65, "a b" * 10, "ä" * 24)
    for opening in (*({"room": room} for room in rooms), {"view_token": "ä" * 24}, {**ROOM_FIELDS, "name": "a" * 41}):
        assert refused(client, baked, opening)[0] == 1008


class Person:
    """An editor's state of a shared look: the confirmed look and its own unconfirmed edits."""

    def __init__(self, session: Session) -> None:
        self.session, self.last = session, 0
        self.look = session.text("hello")["look"]
        self._sent: list[tuple[int, list[dict[str, Any]]]] = []

    def edit(self, path: str, value: float) -> None:
        self.last += 1
        self._sent.append((self.last, [{"op": "replace", "path": path, "value": value}]))
        self.session.edit(self.last, path, value, control=path)

    def hear(self) -> None:
        """Apply the next room update, with own edits up to its revision."""
        message = self.session.text("room_update")
        own = [patch for revision, patch in self._sent if revision <= message["revision"]]
        self._sent = self._sent[len(own) :]
        for patch in [*own, message["patch"]]:
            jsonpatch.apply_patch(self.look, patch, in_place=True)

    @property
    def is_confirmed(self) -> bool:
        return not self._sent


def test_concurrent_drags_converge_to_one_look(client: TestClient, baked: Baked) -> None:
    rng = np.random.default_rng(4)
    with ExitStack() as stack:
        opened = [stack.enter_context(joined(client, baked)) for _ in range(2)]
        people = [Person(session) for session in opened]
        for _ in range(60):
            for person, own in zip(people, (EXTINCTION, IOR), strict=True):
                path = own if rng.random() < 0.6 else SIGMA  # everybody edits this one, too
                person.edit(path, round(float(rng.uniform(1.2, 2.0) if path != SIGMA else rng.uniform(0.1, 0.4)), 3))
        for person in people:
            while not person.is_confirmed:
                person.hear()
        late = stack.enter_context(joined(client, baked))
        everybodys = late.text("hello")["look"]
        for person in people:
            while person.look["materials"] != everybodys["materials"]:
                person.hear()


def test_rooms_are_limited_and_end_with_their_last_member(client: TestClient, baked: Baked) -> None:
    with (
        open_session(client, baked.bake, opening={"room": "a" * 24}) as first,
        open_session(client, baked.bake, opening={"room": "b" * 24}) as second,
    ):
        first.text("hello")
        second.text("hello")
        code, reason = refused(client, baked, {"room": "c" * 24})
        assert (code, reason) == (1013, "2 rooms are open, which is the limit; wait until one is closed")
    while True:  # members who left stay for a moment
        with open_session(client, baked.bake, opening={"room": "c" * 24}) as third:
            message = third.websocket.receive()
            if message["type"] != "websocket.close":
                break


def test_edit_that_cannot_be_shown_is_undone_for_all(client: TestClient, baked: Baked) -> None:
    rotation = "/environment/rotation"  # the bake does not support it
    with joined(client, baked) as ann, joined(client, baked) as bob:
        ann.exact(0)
        bob.exact(0)
        ann.edit(1, EXTINCTION, 1.7)
        ann.exact(1)
        ann.edit(2, rotation, 1.0)
        assert ann.text("problem")["revision"] == 2
        ann.edit(3, SIGMA, 0.31)
        picture(bob, 0, 810)
        with joined(client, baked) as late:
            look = late.text("hello")["look"]
        assert look["environment"]["rotation"] == 0.0
        assert look["materials"]["Paper"]["terms"][1]["params"]["extinction"] == 1.7
