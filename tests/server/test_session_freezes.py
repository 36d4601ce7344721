"""Live sessions during a freeze: edits that continue, wait or cancel it."""

import time

import numpy as np
import pytest
from fastapi.testclient import TestClient
from server_fakes import Control
from session_client import IOR, SIGMA, THETA_D, THETA_H, Baked, Frame, open_session


def test_prepare_freezes_and_sends_the_curve(client: TestClient, baked: Baked, control: Control) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="prepare", curve=THETA_D)
        curve = session.text("curve")
        assert curve["curve"] == THETA_D
        assert len(curve["bands"]) == 3
        assert curve["bands"] == curve["generated"]
        status = session.text("status")
        assert status["state"] == "precomputing"
        assert status["label"] == "Paper, theta_d"
        control.freeze_gate.set()
        while session.text("status")["state"] != "ready":
            pass
        session.edit(1, IOR, 2.0)
        session.exact(1)
        assert session.text("curve")["revision"] == 1


def test_active_slider_freezes_and_keeps_the_open_curve(client: TestClient, baked: Baked, control: Control) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="prepare", curve=THETA_H)
        assert session.text("curve")["curve"] == THETA_H
        session.send_message(type="prepare", parameter=IOR)
        assert session.text("status")["label"] == "Paper, ior"
        control.freeze_gate.set()
        while session.text("status")["state"] != "ready":
            pass
        session.edit(1, SIGMA, 0.4)
        assert session.text("curve")["curve"] == THETA_H


def test_reopened_curve_is_sent_again(client: TestClient, baked: Baked, control: Control) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        control.freeze_gate.set()
        session.send_message(type="prepare", curve=THETA_H)
        first = session.text("curve")
        session.send_message(type="prepare", parameter=IOR)
        session.send_message(type="prepare", curve=THETA_H)
        session.edit(1, "/environment/intensity", 2.0)
        got = []
        while not isinstance(message := session.receive(), Frame) or message.header["revision"] < 1:
            got.append(message)
        (second,) = [each for each in got if isinstance(each, dict) and each["type"] == "curve"]
        assert second["bands"] == first["bands"]


def test_active_rotation_is_not_an_error(client: TestClient, baked: Baked, control: Control) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        control.freeze_gate.set()
        session.send_message(type="prepare", parameter="/environment/rotation")
        session.edit(1, SIGMA, 0.4)
        session.exact(1)


@pytest.mark.parametrize(
    "touch",
    [
        {},
        {"curve": THETA_H, "parameter": IOR},
        {"parameter": THETA_H},
        {"parameter": IOR.replace("ior", "colour")},
        {"parameter": IOR.replace("Paper", "Nobody")},
        {"parameter": IOR.replace("/1/", "/999/")},
        {"parameter": "/lights/Nobody"},
        {"parameter": "/environment"},
    ],
)
def test_invalid_prepare_is_rejected(client: TestClient, baked: Baked, touch: dict[str, str]) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="prepare", **touch)
        assert session.text("problem")["problem"]["detail"]
        session.edit(1, SIGMA, 0.4)
        session.exact(1)


def test_refinement_waits_for_the_end_of_the_drag(
    client: TestClient, baked: Baked, control: Control, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("relume_server.session.frames.frame_loop.BACKGROUND_DELAY_S", 3600.0)
    control.is_refinement = True
    with open_session(client, baked.bake) as session:
        session.exact(0)
        for revision in (1, 3, 5):
            session.edit(revision, IOR, 2.0 + revision)
            session.edit(revision + 1, SIGMA, revision / 10)
            session.frame()
        assert not control.freeze_started.is_set()


def test_drag_with_a_pending_edit_is_not_idle(
    client: TestClient, baked: Baked, control: Control, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("relume_server.session.frames.frame_loop.BACKGROUND_DELAY_S", 0.5)
    control.is_refinement = True
    with open_session(client, baked.bake, acknowledges=False) as session:
        session.frame()
        session.edit(1, IOR, 2.0)
        session.edit(2, SIGMA, 0.3)
        second = session.frame()
        session.edit(3, SIGMA, 0.4)
        assert not control.freeze_started.wait(0.8)
        session.send_message(type="ack", frame=second.header["frame"])
        assert session.frame().header["revision"] == 3
        assert control.freeze_started.wait(60)
        control.freeze_gate.set()


def test_refinement_runs_when_idle(client: TestClient, baked: Baked, control: Control) -> None:
    control.is_refinement = True
    control.freeze_gate.set()
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.edit(1, IOR, 2.0)
        session.exact(1)


def test_another_curve_cancels_the_freeze_without_error(
    client: TestClient, baked: Baked, control: Control, caplog: pytest.LogCaptureFixture
) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="prepare", curve=THETA_D)
        assert control.freeze_started.wait(60)
        session.send_message(type="prepare", curve=THETA_H)
        while session.text("status")["state"] != "ready":
            pass
        assert control.num_cancelled == 1
    assert [line for line in caplog.records if line.name.startswith("relume_server.session")] == []


def test_edits_without_freeze_are_shown_during_one(client: TestClient, baked: Baked, control: Control) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="prepare", curve=THETA_D)
        assert control.freeze_started.wait(60)
        for revision in range(1, 6):
            session.edit(revision, SIGMA, 0.2 + revision / 10)
            frame = session.exact(revision)
            assert np.frombuffer(frame.payload, "<u4")[0] == 700 + 100 * revision
        assert not control.freeze_gate.is_set()
        assert control.num_cancelled == 0


def test_edit_that_needs_a_freeze_keeps_the_last_frame_and_others_continue(
    client: TestClient, baked: Baked, control: Control
) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.edit(1, IOR, 2.0)
        assert session.text("status")["label"] == "Paper, theta_d"
        session.edit(2, SIGMA, 0.3)
        frame = session.frame()  # the first one: revision 1 had no frame
        assert (frame.header["revision"], frame.header["exact"]) == (2, False)
        assert np.frombuffer(frame.payload, "<u4")[0] == 800
        control.freeze_gate.set()
        assert np.frombuffer(session.exact(2).payload, "<u4")[0] == 1300


def test_display_edit_gets_a_frame_during_a_freeze(client: TestClient, baked: Baked, control: Control) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.edit(1, IOR, 2.0)
        assert control.freeze_started.wait(60)
        session.edit(2, "/display/exposure", 1.0)
        frame = session.frame()
        assert (frame.header["revision"], frame.header["exact"], frame.header["tiles"]) == (2, False, [])
        session.send_message(type="inspect", x=3, y=4)
        assert session.text("inspect")["radiance"] == pytest.approx([0.7] * 3, rel=1e-6)
        control.freeze_gate.set()
        session.exact(2)


def test_reverted_edit_cancels_the_freeze(client: TestClient, baked: Baked, control: Control) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.edit(1, IOR, 2.0)
        assert control.freeze_started.wait(60)
        session.edit(2, IOR, 1.5)
        session.exact(2)
        while session.text("status")["state"] != "ready":
            pass
        assert control.num_cancelled == 1


def test_edit_of_the_frozen_curve_does_not_cancel_the_freeze(
    client: TestClient, baked: Baked, control: Control
) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="prepare", curve=THETA_D)
        assert control.freeze_started.wait(60)
        session.edit(1, IOR, 2.0)
        session.edit(2, IOR, 2.1)
        control.freeze_gate.set()
        session.exact(2)
        assert control.num_cancelled == 0


def test_other_views_do_not_wait_for_a_freeze(client: TestClient, baked: Baked, control: Control) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="prepare", curve=THETA_D)
        assert control.freeze_started.wait(60)
        session.send_message(type="view", name="left")
        assert session.exact(0).header["view"] == "left"
        while control.num_cancelled == 0:
            time.sleep(0.01)
        control.freeze_gate.set()
