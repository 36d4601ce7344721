"""Live sessions with a picture whose pixels are known."""

import asyncio
import io
import json
import struct
import threading
import time

import numpy as np
import pytest
from fastapi.testclient import TestClient
from PIL import Image
from server_fakes import SIZE, Control
from server_fixtures import impatient
from session_client import SIGMA, THETA_H, Baked, open_session

from relume.image_io.tone_mapping import tone_map
from relume.image_io.write_image import to_bytes
from relume_server.client_state.flow_control import FrameWindow
from relume_server.client_state.socket import ClientSocket
from relume_server.schemas.protocol import FrameHeader

WIDTH, HEIGHT = SIZE


def test_hello_precedes_a_complete_exact_picture(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        hello = session.receive()
        assert isinstance(hello, dict)
        assert hello["type"] == "hello"
        assert (hello["scene"], hello["method"]) == (baked.scene, "direct")
        camera = {"to_world": np.eye(4).ravel().tolist(), "yfov": 0.8, "near": 0.0}
        assert hello["views"] == [
            {
                "name": n,
                "width": WIDTH,
                "height": HEIGHT,
                "camera": camera,
                "camera_mode": "fixed",
                "bounds": None,
                "interior_camera": None,
            }
            for n in ("front", "left")
        ]
        assert hello["look"]["materials"]["Paper"]["terms"][1]["params"]["sigma"] == 0.2
        assert not hello["resumed"]
        frame = session.frame()
        FrameHeader.model_validate(frame.header)
        assert frame.header["revision"] == 0
        assert frame.header["format"] == "rgb9e5"
        assert sum(w * h for _, _, w, h in frame.header["tiles"]) == WIDTH * HEIGHT
        assert len(frame.payload) == 4 * WIDTH * HEIGHT
        assert frame.header["exact"]


def test_edit_gives_a_frame_of_its_revision_with_the_changed_tiles(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.edit(1, SIGMA, 0.31)
        frame = session.exact(1)
        assert frame.header["tiles"] == [[0, 0, 64, 64]]
        assert np.frombuffer(frame.payload, "<u4").tolist() == [810] * (64 * 64)
        assert frame.header["ms"]["wait"] >= 0


def test_refinement_ends_in_an_exact_frame(client: TestClient, baked: Baked, control: Control) -> None:
    control.max_step = 3
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.edit(1, SIGMA, 0.5)
        first = session.frame()
        assert first.header["revision"] == 1
        assert not first.header["exact"]
        last = session.exact(1)
        assert np.frombuffer(last.payload, "<u4")[0] == 1000


def test_unacknowledged_edits_are_merged_into_the_newest(client: TestClient, baked: Baked, control: Control) -> None:
    with open_session(client, baked.bake, acknowledges=False) as session:
        first = session.frame()
        session.edit(1, SIGMA, 0.3)
        second = session.frame()
        for revision in range(2, 60):
            session.edit(revision, SIGMA, 0.3 + revision / 1000)
        session.edit(60, SIGMA, 5.0)  # rejected: its response confirms that all earlier edits arrived
        assert session.text("problem")["revision"] == 60
        num_looks = control.num_looks
        session.send_message(type="ack", frame=second.header["frame"])
        third = session.frame()
        assert [f.header["frame"] for f in (first, second, third)] == [1, 2, 3]
        assert third.header["revision"] == 59
        assert control.num_looks == num_looks + 1


def test_delayed_frame_shows_the_newest_state(client: TestClient, baked: Baked, control: Control) -> None:
    turns = client.app.state.services.threads.short_slots  # type: ignore[attr-defined]
    assert client.portal is not None
    with open_session(client, baked.bake) as session:
        session.exact(0)
        while not turns.locked():
            client.portal.call(turns.acquire)
        num_looks = control.num_looks
        for revision in range(1, 9):
            session.edit(revision, SIGMA, 0.3 + revision / 1000)
        session.edit(9, SIGMA, 5.0)
        assert session.text("problem")["revision"] == 9
        client.portal.call(turns.release)
        assert session.frame().header["revision"] == 8
        assert control.num_looks == num_looks + 1


def test_ping_is_answered_while_frames_wait(client: TestClient, baked: Baked) -> None:
    turns = client.app.state.services.threads.short_slots  # type: ignore[attr-defined]
    assert client.portal is not None
    with open_session(client, baked.bake) as session:
        session.exact(0)
        while not turns.locked():
            client.portal.call(turns.acquire)
        session.edit(1, SIGMA, 0.3)
        session.send_message(type="ping")
        assert session.receive() == {"type": "pong"}
        client.portal.call(turns.release)
        assert session.exact(1).header["revision"] == 1


def test_next_frame_is_rendered_while_one_is_sent(
    client: TestClient, baked: Baked, control: Control, monkeypatch: pytest.MonkeyPatch
) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        num_looks, send_frame, goes_out = control.num_looks, ClientSocket.send_frame, threading.Event()

        async def send_late(self: ClientSocket, frame: bytes) -> None:
            while not goes_out.is_set():
                await asyncio.sleep(0.001)
            await send_frame(self, frame)

        monkeypatch.setattr(ClientSocket, "send_frame", send_late)
        for revision in (1, 2):
            session.edit(revision, SIGMA, 0.3 + revision / 100)
            deadline = time.monotonic() + 10
            while control.num_looks < num_looks + revision and time.monotonic() < deadline:
                time.sleep(0.001)
            assert control.num_looks == num_looks + revision
        goes_out.set()
        assert [session.frame().header["revision"] for _ in range(2)] == [1, 2]


@impatient
def test_client_without_acknowledgements_gets_two_frames_and_an_error(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake, acknowledges=False) as session:
        session.text("hello")
        session.frame()
        session.edit(1, SIGMA, 0.3)
        session.frame()
        session.edit(2, SIGMA, 0.4)
        with pytest.raises(ConnectionError) as closed:
            session.receive()
        assert closed.value.args[0] == 4408
        assert "acknowledged" in closed.value.args[1]


def test_unsupported_look_is_undone(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.edit(1, "/environment/rotation", 30.0)
        problem = session.text("problem")
        assert problem["revision"] == 1
        assert problem["problem"]["type"] == "urn:relume:problem:edit-not-supported"
        session.edit(2, SIGMA, 0.4)
        session.exact(2)


def test_active_control_reaches_the_picture_with_its_edit(client: TestClient, baked: Baked, control: Control) -> None:
    patch = [{"op": "replace", "path": SIGMA, "value": 0.31}]
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="edit", revision=1, patch=patch, active_control=SIGMA)
        session.exact(1)
        session.send_message(type="edit", revision=2, patch=patch, active_control=THETA_H)
        session.exact(2)
        session.edit(3, SIGMA, 0.4)
        session.exact(3)
    assert control.controls[-3:] == [SIGMA, THETA_H, None]


@pytest.mark.parametrize("hand", ["/display/exposure", "/lights/Nobody", SIGMA.replace("Paper", "Nobody")])
def test_edit_with_an_invalid_active_control_is_rejected(client: TestClient, baked: Baked, hand: str) -> None:
    patch = [{"op": "replace", "path": SIGMA, "value": 0.31}]
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="edit", revision=1, patch=patch, active_control=hand)
        problem = session.text("problem")
        assert (problem["revision"], problem["problem"]["type"]) == (1, "urn:relume:problem:parameter")
        session.edit(1, "/display/exposure", 1.0)
        frame = session.exact(1)
        assert frame.header["tiles"] == []


def test_solo_persists_and_is_not_part_of_the_look(client: TestClient, baked: Baked, control: Control) -> None:
    with open_session(client, baked.bake) as session:
        hello = session.text("hello")
        assert hello["solo"] is None
        session.exact(0)
        session.send_message(type="edit", revision=1, patch=[], solo=["environment", "Lamp"])
        assert session.exact(1).header["tiles"] == []
        session.edit(2, SIGMA, 0.4)
        session.exact(2)
    alone = frozenset({"environment", "Lamp"})
    assert control.solos[-2:] == [alone, alone]
    with open_session(client, baked.bake, opening={"resume": hello["resume"]}) as session:
        resumed = session.text("hello")
        assert resumed["solo"] == ["Lamp", "environment"]
        assert resumed["look"]["environment"] == hello["look"]["environment"]
        session.exact(2)
        assert control.solos[-1] == alone
        session.send_message(type="edit", revision=3, patch=[], solo=None)
        session.exact(3)
        assert control.solos[-1] is None


def test_solo_of_an_undone_edit_is_undone(client: TestClient, baked: Baked, control: Control) -> None:
    turn = [{"op": "replace", "path": "/environment/rotation", "value": 30.0}]
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="edit", revision=1, patch=turn, solo=["Lamp"])
        assert session.text("problem")["revision"] == 1
        session.edit(2, SIGMA, 0.4)
        session.exact(2)
    assert control.solos[-1] is None


@pytest.mark.parametrize(
    "fields", [{}, {"active_control": SIGMA}, {"solo": []}, {"solo": ["Lamp"] * 100}, {"solo": "Lamp"}]
)
def test_empty_edit_is_rejected(client: TestClient, baked: Baked, fields: dict[str, object]) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="edit", revision=1, patch=[], **fields)
        assert session.text("problem")["problem"]["type"] == "urn:relume:problem:invalid-request"


def test_pixel_probe_and_brush_get_responses(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="inspect", view="front", x=3, y=4)
        probe = session.text("inspect")
        assert (probe["x"], probe["y"], probe["material"]) == (3, 4, "Paper")
        assert (probe["position"], probe["normal"]) == ([1.0, 2.0, 3.0], [0.0, 1.0, 0.0])
        assert probe["radiance"] == pytest.approx([0.7] * 3, rel=1e-6)
        assert np.shape(probe["bands"]) == (3, 4)
        session.send_message(type="highlight_curve_range", curve=THETA_H, **{"from": 9.0, "to": 54.0})
        frame = session.frame()
        assert frame.header["kind"] == "highlight"
        assert frame.header["format"] == "r8"
        assert frame.payload == bytes([128]) * (WIDTH * HEIGHT)


def test_view_switch_sends_the_complete_picture(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.edit(1, SIGMA, 0.4)
        session.exact(1)
        session.send_message(type="view", name="left", size=[512, 512])
        frame = session.exact(1)
        assert frame.header["view"] == "left"
        assert len(frame.payload) == 4 * WIDTH * HEIGHT


def test_jpeg_stream_sends_complete_images(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="encoding", format="jpeg", quality=70)
        session.edit(1, SIGMA, 0.4)
        frame = session.exact(1)
        assert frame.header["format"] == "jpeg"
        assert frame.header["tiles"] == [[0, 0, WIDTH, HEIGHT]]
        assert frame.payload[:2] == b"\xff\xd8"


def test_png_stream_sends_the_displayed_image_without_loss(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="encoding", format="png")
        session.send_message(type="view", name="left", size=[80, 80])  # only JPEGs are scaled down
        session.edit(1, SIGMA, 0.4)
        while (frame := session.exact(1)).header["view"] != "left":
            pass
    assert (frame.header["format"], frame.header["tiles"]) == ("png", [[0, 0, WIDTH, HEIGHT]])
    displayed = to_bytes(tone_map(np.full((HEIGHT, WIDTH, 3), 0.9, np.float32), 0.0, "agx"))
    assert np.array_equal(np.array(Image.open(io.BytesIO(frame.payload))), displayed)


@pytest.mark.parametrize(
    ("space", "sent"),
    [
        ([80, 400], (80, 48)),
        ([400, 24], (40, 24)),
        ([1000, 1000], SIZE),
        ([0, 0], (1, 1)),
        (None, SIZE),
    ],
)
def test_jpeg_fits_the_display_size(
    client: TestClient, baked: Baked, space: list[int] | None, sent: tuple[int, int]
) -> None:
    with open_session(client, baked.bake) as session:
        session.send_message(type="encoding", format="jpeg")
        session.send_message(type="view", name="left", size=space)
        session.edit(1, SIGMA, 0.4)
        frame = session.exact(1)
        assert Image.open(io.BytesIO(frame.payload)).size == sent
        assert (frame.header["width"], frame.header["height"]) == SIZE
        assert frame.header["tiles"] == [[0, 0, WIDTH, HEIGHT]]


def test_display_size_applies_until_the_view_layout_changes(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        session.send_message(type="encoding", format="jpeg")
        session.send_message(type="view", name="left", size=[80, 80])
        session.send_message(type="views", names=["left"])
        session.edit(1, SIGMA, 0.4)
        assert Image.open(io.BytesIO(session.exact(1).payload)).size == SIZE


def test_display_size_does_not_affect_hdr_frames(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        session.send_message(type="view", name="left", size=[8, 8])
        session.edit(1, SIGMA, 0.4)
        while (frame := session.exact(1)).header["view"] != "left":
            pass
        assert frame.header["format"] == "rgb9e5"
        assert (frame.header["width"], frame.header["height"]) == (WIDTH, HEIGHT)
        assert len(frame.payload) == 4 * sum(width * height for _, _, width, height in frame.header["tiles"])


def test_slow_link_gets_jpeg_during_drags_and_one_hdr_frame_after(
    client: TestClient, baked: Baked, control: Control, monkeypatch: pytest.MonkeyPatch
) -> None:
    control.max_step = 3
    monkeypatch.setattr(FrameWindow, "is_slow_for", lambda *_, was_slow: True)
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.edit(1, SIGMA, 0.4)
        while (moving := session.frame()).header["revision"] != 1:
            pass
        assert moving.header["format"] == "jpeg"
        still = session.exact(1)
        assert still.header["format"] == "rgb9e5"
        assert np.frombuffer(still.payload, "<u4").size == WIDTH * HEIGHT


def test_finer_bake_is_announced(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        finer = {"scene": baked.scene, "method": "direct", "size": [WIDTH, HEIGHT], "lights": 50}
        coarser = {"scene": baked.scene, "method": "direct", "size": [16, 16], "lights": 5}
        client.post("/api/bakes", json=coarser)
        bake = client.post("/api/bakes", json=finer).json()["id"]
        while (news := session.text("bake"))["state"] != "ready":
            assert news["bake"] == bake
        assert (news["bake"], news["replaces"]) == (bake, baked.bake)


def test_resume_restores_look_and_revision_once(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        token = session.text("hello")["resume"]
        session.edit(7, SIGMA, 0.4)
        session.exact(7)
    with open_session(client, baked.bake, opening={"resume": token}) as session:
        hello = session.text("hello")
        assert hello["resumed"]
        assert hello["revision"] == 7
        assert hello["look"]["materials"]["Paper"]["terms"][1]["params"]["sigma"] == 0.4
        session.exact(7)
        session.edit(8, SIGMA, 0.3)
        session.exact(8)
    with open_session(client, baked.bake, opening={"resume": token}) as session:
        assert not session.text("hello")["resumed"]


def test_whole_look_can_be_replaced(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        look = session.text("hello")["look"]
        look["materials"]["Paper"]["terms"][1]["params"]["sigma"] = 0.35
        session.edit(1, "", look)
        session.exact(1)


def test_sessions_share_one_open_store(client: TestClient, baked: Baked, control: Control) -> None:
    with open_session(client, baked.bake) as first, open_session(client, baked.bake) as second:
        first.exact(0)
        second.exact(0)
    assert control.num_opened == 1


def test_excess_sessions_are_rejected_with_a_reason(client: TestClient, baked: Baked) -> None:
    with (
        open_session(client, baked.bake),
        open_session(client, baked.bake),
        open_session(client, baked.bake),
        open_session(client, baked.bake) as fourth,
        pytest.raises(ConnectionError) as closed,
    ):
        fourth.receive()
    assert closed.value.args[0] == 1013


def test_frame_message_is_length_header_payload(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake, acknowledges=False) as session:
        while (message := session.websocket.receive()).get("bytes") is None:
            pass
        data = message["bytes"]
        (length,) = struct.unpack("<I", data[:4])
        header = json.loads(data[4 : 4 + length])
        assert len(data) == 4 + length + 4 * sum(w * h for _, _, w, h in header["tiles"])
