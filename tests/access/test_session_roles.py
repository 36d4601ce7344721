"""Live sessions: permission to open one and to edit in it, and its end when a token is revoked."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest
from anyio.from_thread import start_blocking_portal
from fastapi.testclient import TestClient
from session_client import ROOM_FIELDS, SIGMA, THETA_H, Baked, open_session

from relume_server.auth.audit import Entry
from relume_server.auth.roles import Caller, Role
from relume_server.auth.services import AuthServices
from relume_server.collaboration.join import JoinRequest
from relume_server.collaboration.room import Room
from relume_server.session.audit_edits import AuditWriter
from relume_server.settings import Settings

EXPOSURE_EDIT = {"op": "replace", "path": "/display/exposure", "value": 2.0}
Bearer = Callable[..., dict[str, str]]


@pytest.fixture(autouse=True)
def _quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relume_server.auth.services.TOKEN_CACHE_S", 0.05)
    monkeypatch.setattr("relume_server.auth.tokens.TOKEN_CACHE_S", 0.0)


def test_anonymous_callers_cannot_open_a_session(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session, pytest.raises(ConnectionError) as ended:
        session.receive()
    assert ended.value.args[0] == 4401
    assert "a login is required; send a token" in ended.value.args[1]


def test_edits_are_in_the_audit_log(client: TestClient, baked: Baked, bearer: Bearer, access: AuthServices) -> None:
    opening = {"room": "abcdefgh" * 4}
    with open_session(client, baked.bake, opening=opening, headers=bearer("edit", "Ann")) as session:
        hello = session.text("hello")
        assert hello["role"] == "edit"
        session.edit(1, SIGMA, 0.3)
        session.edit(2, EXPOSURE_EDIT["path"], 2.0)
        session.exact(2)
        assert access.audit.list() == []
    (line,) = lines_of(access, 1)  # it is written when the session ends
    assert (line.who, line.what) == ("Ann", "2 edits in a session: /materials/Paper, /display/exposure")
    assert line.object == f"/api/bakes/{baked.bake}/session, {hello['session']}, room abcdefgh…"


def test_edits_are_in_the_audit_log_before_the_session_ends(
    client: TestClient, baked: Baked, bearer: Bearer, access: AuthServices, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("relume_server.session.audit_edits.WRITE_INTERVAL_S", 0.05)
    with open_session(client, baked.bake, headers=bearer("edit", "Ann")) as session:
        session.text("hello")
        for k in (1, 2):
            session.edit(k, SIGMA, 0.3 + k / 10)
            assert [line.what for line in lines_of(access, k)] == ["1 edits in a session: /materials/Paper"] * k
        time.sleep(0.2)  # no line without edits
    assert len(lines_of(access, 2)) == 2


def lines_of(access: AuthServices, least: int) -> Sequence[Entry]:
    """The audit lines, once there are at least so many."""
    while len(lines := access.audit.list()) < least:
        time.sleep(0.01)
    return lines


def test_audit_line_of_edits_is_bounded_and_valid_json(access: AuthServices) -> None:
    async def edit(places: Sequence[str]) -> str:
        notes = AuditWriter(access.audit, Caller("Ann", Role.EDIT, "", "token"), "here")
        notes.add_edit(places)
        await notes.write()
        await notes.write()
        return access.audit.list()[0].what

    with start_blocking_portal() as portal:  # a browser's loop may run in this thread
        assert portal.call(edit, ["/materials/a\x1b\n"]) == "1 edits in a session: /materials/a??"
        assert portal.call(edit, []) == "1 edits in a session"
        many = portal.call(edit, [f"/materials/{k:020d}" for k in range(1000)])
        assert many.startswith(f"1 edits in a session: /materials/{0:020d}, ")
        assert many.endswith(" and 96 more")
        assert len(many) < 200
        long = portal.call(edit, ["/materials/" + "x" * 1000])
        assert 100 < len(long) < 200
    assert len(access.audit.list()) == 4


def test_viewers_watch_and_their_edits_are_rejected_with_a_reason(
    client: TestClient, baked: Baked, bearer: Bearer
) -> None:
    with open_session(client, baked.bake, headers=bearer("view", "Vera")) as session:
        assert session.text("hello")["role"] == "view"
        before = session.exact(0)
        session.send_message(
            type="edit", revision=1, patch=[EXPOSURE_EDIT, {"op": "replace", "path": SIGMA, "value": 0.3}]
        )
        problem = session.text("problem")
        assert (problem["revision"], problem["problem"]["status"]) == (1, 403)
        assert problem["problem"]["detail"].startswith("Vera has view-only access; ask an admin")
        session.send_message(type="prepare", parameter=SIGMA)
        assert session.text("problem")["problem"]["status"] == 403
        session.send_message(
            type="edit", revision=1, patch=[EXPOSURE_EDIT], active_control=SIGMA
        )  # this would prepare an operator
        assert session.text("problem")["problem"]["status"] == 403
        session.send_message(type="prepare", curve=THETA_H)
        shape = session.text("curve")
        assert (shape["curve"], len(shape["bands"])) == (THETA_H, len(shape["generated"]))
        session.send_message(type="view", name="front")
        again = session.exact(0)
        assert again.payload == before.payload
        session.send_message(type="edit", revision=2, patch=[], solo=["environment"])
        session.exact(2)
        session.send_message(type="edit", revision=3, patch=[EXPOSURE_EDIT])
        session.exact(3)
        session.send_message(type="inspect", x=3, y=4)
        assert session.text("inspect")["material"] == "Paper"


def test_display_changes_of_viewers_are_not_edits(
    client: TestClient, baked: Baked, bearer: Bearer, access: AuthServices
) -> None:
    ann, vera = bearer("edit", "Ann"), bearer("view", "Vera")
    with open_session(client, baked.bake, opening=ROOM_FIELDS, headers=ann) as editor:
        editor.text("hello")
        with open_session(client, baked.bake, opening=ROOM_FIELDS, headers=vera) as viewer:
            viewer.send_message(type="edit", revision=1, patch=[EXPOSURE_EDIT])
            viewer.exact(1)
            with open_session(client, baked.bake, opening=ROOM_FIELDS, headers=bearer("edit", "Bob")) as late:
                assert late.text("hello")["look"]["display"]["exposure"] == 0.0
    assert access.audit.list() == []


def test_participant_token_is_bound_to_its_user(client: TestClient, baked: Baked, bearer: Bearer) -> None:
    with open_session(client, baked.bake, opening=ROOM_FIELDS, headers=bearer("edit", "Ann")) as ann:
        participant_token = ann.text("hello")["room"]["participant_token"]
        opening = {**ROOM_FIELDS, "participant_token": participant_token}
        with open_session(client, baked.bake, opening=opening, headers=bearer("view", "Vera")) as vera:
            room = vera.text("hello")["room"]
            assert [(each["name"], each["role"]) for each in room["people"]] == [("Ann", "edit"), ("Vera", "view")]


def test_proxy_users_resume_only_their_own_participant() -> None:
    room = Room({}, 8, 60.0, lambda room: None)
    door = JoinRequest(ROOM_FIELDS["room"], "watch", None, None)
    ann = room.join(door, Caller("proxy:Ann", Role.EDIT, "10.0.0.5", "proxy"))
    back = replace(door, participant_token=ann.token)
    assert room.join(back, Caller("proxy:Ann", Role.EDIT, "10.0.0.5", "proxy")) is ann
    assert room.join(back, Caller("Ann", Role.VIEW, "10.0.0.9", "token")) is not ann
    assert [(person.name, person.role) for person in room.people()] == [("Ann", "edit"), ("Ann", "view")]


def test_viewers_see_shared_and_saved_looks(client: TestClient, baked: Baked, bearer: Bearer) -> None:
    editor, viewer = bearer("edit"), bearer("view")
    blue = [{"model": "lambert", "color": [0.25, 0.5, 0.75]}, {"model": "cook_torrance", "color": [0.5, 0.5, 0.5]}]
    look = {"materials": {"Paper": {"terms": blue}}}
    request = {"bake": baked.bake, "view": "front", "views": ["front"], "look": look}
    share = client.post("/api/shares", json=request, headers=editor).json()["id"]
    client.put("/api/looks/Blue", json=look, headers=editor)
    for opening in ({"share": share}, {"look": "Blue"}):
        with open_session(client, baked.bake, opening=opening, headers=viewer) as session:
            shown = session.text("hello")["look"]["materials"]["Paper"]["terms"]
            assert [term["color"] for term in shown] == [[0.25, 0.5, 0.75], [0.5, 0.5, 0.5]]
            session.exact(0)
    gone = open_session(client, baked.bake, opening={"share": "aaaaaaaaaa"}, headers=viewer)
    with gone as session, pytest.raises(ConnectionError, match="there is no shared look"):
        session.receive()


def test_revoking_a_token_ends_its_sessions_and_no_others(
    client: TestClient, baked: Baked, access: AuthServices, bearer: Bearer
) -> None:
    ann, bob = bearer("edit", "Ann"), bearer("edit", "Bob")
    with (
        open_session(client, baked.bake, headers=ann) as of_ann,
        open_session(client, baked.bake, headers=bob) as of_bob,
    ):
        of_ann.exact(0)
        of_bob.exact(0)
        access.tokens.revoke("Ann")
        with pytest.raises(ConnectionError) as ended:
            of_ann.text("never")
        assert ended.value.args == (4401, "your token expired or was revoked; log in with a new one")
        of_bob.edit(1, SIGMA, 0.3)
        of_bob.exact(1)


class TestQuota:
    @pytest.fixture
    def settings(self, settings: Settings) -> Settings:
        settings.max_sessions_per_user = 1
        return settings

    def test_sessions_per_user_are_limited(self, client: TestClient, baked: Baked, bearer: Bearer) -> None:
        ann, bob = bearer("edit", "Ann"), bearer("edit", "Bob")
        with open_session(client, baked.bake, headers=ann) as first:
            first.text("hello")
            with open_session(client, baked.bake, headers=ann) as second, pytest.raises(ConnectionError) as ended:
                second.receive()
            assert ended.value.args[0] == 1013
            assert "RELUME_MAX_SESSIONS_PER_USER" in ended.value.args[1]
            with open_session(client, baked.bake, headers=bob) as other:
                other.text("hello")
        with open_session(client, baked.bake, headers=ann) as again:
            again.text("hello")
