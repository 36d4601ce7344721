"""Several views of one bake side by side: each edit changes all, the focused one first."""

import time

import numpy as np
import pytest
from fastapi.testclient import TestClient
from server_fakes import Control
from server_fixtures import impatient
from session_client import IOR, SIGMA, THETA_D, THETA_H, Baked, Frame, Session, open_session


def exact_of_all(session: Session, revision: int, num_views: int = 2) -> list[Frame]:
    """Read until each view has an exact frame of a revision; return the frames in order of arrival."""
    frame_by_view: dict[str, Frame] = {}
    while len(frame_by_view) < num_views:
        frame = session.exact(revision)
        frame_by_view[frame.header["view"]] = frame
    return list(frame_by_view.values())


def show_both(session: Session, focus: str = "left") -> None:
    session.exact(0)
    session.send_message(type="views", names=["front", "left"])
    session.send_message(type="focus", view=focus)
    exact_of_all(session, 0)


@pytest.mark.parametrize("focus", ["front", "left"])
def test_edits_change_all_views_the_focused_one_first(client: TestClient, baked: Baked, focus: str) -> None:
    with open_session(client, baked.bake) as session:
        show_both(session, focus)
        for revision in range(1, 4):
            session.edit(revision, SIGMA, 0.2 + revision / 10)
            frames = exact_of_all(session, revision)
            assert frames[0].header["view"] == focus
            for frame in frames:
                assert np.frombuffer(frame.payload, "<u4")[0] == 700 + 100 * revision


@impatient
def test_client_without_acknowledgements_gets_one_focused_and_one_other_frame(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake, acknowledges=False) as session:
        session.send_message(type="ack", frame=session.frame().header["frame"])
        session.send_message(type="views", names=["front", "left"])
        shown = [session.frame().header["view"] for _ in range(2)]
        assert sorted(shown) == ["front", "left"]
        session.edit(1, SIGMA, 0.5)
        with pytest.raises(ConnectionError) as closed:
            session.frame()
        assert closed.value.args[0] == 4408


def test_freezes_follow_the_same_order_and_name_their_view(client: TestClient, baked: Baked, control: Control) -> None:
    with open_session(client, baked.bake) as session:
        show_both(session)
        session.edit(1, IOR, 2.0)
        statuses = [session.text("status")]
        control.freeze_gate.set()
        while sum(status["state"] == "ready" for status in statuses) < 2:
            statuses.append(session.text("status"))
        ready = [status["view"] for status in statuses if status["state"] == "ready"]
        assert (statuses[0]["view"], ready) == ("left", ["left", "front"])
        session.edit(2, IOR, 2.5)
        exact_of_all(session, 2)


def test_prepare_reaches_all_views_and_each_answers_a_brush(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        show_both(session)
        session.send_message(type="highlight_curve_range", curve=THETA_H, **{"from": 9.0, "to": 54.0})
        frames = [session.frame() for _ in range(2)]
        assert [frame.header["kind"] for frame in frames] == ["highlight", "highlight"]
        assert [frame.header["view"] for frame in frames] == ["left", "front"]


def test_pixel_probe_uses_the_named_or_the_focused_view(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        show_both(session)
        session.send_message(type="inspect", x=1, y=1)
        assert session.text("inspect")["view"] == "left"
        session.send_message(type="inspect", view="front", x=1, y=1)
        assert session.text("inspect")["view"] == "front"


def test_view_without_memory_for_the_open_curve_is_shown_without_it(
    client: TestClient, baked: Baked, control: Control
) -> None:
    control.views_over_budget = {"left"}
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(type="prepare", curve=THETA_H)
        session.text("curve")
        session.send_message(type="view", name="left")
        assert session.text("problem")["revision"] is None
        session.edit(1, SIGMA, 0.3)
        assert session.exact(1).header["view"] == "left"


def test_single_view_after_several(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        show_both(session)
        session.send_message(type="view", name="front")
        assert session.exact(0).header["view"] == "front"
        for revision in (1, 2, 3):
            session.edit(revision, SIGMA, 0.2 + revision / 10)
            assert session.exact(revision).header["view"] == "front"
        session.send_message(type="focus", view="left")
        assert session.text("problem")["problem"]["parameter"] == "view"


def test_resume_restores_the_views(client: TestClient, baked: Baked) -> None:
    with open_session(client, baked.bake) as session:
        hello = session.text("hello")
        assert (hello["visible_views"], hello["focused_view"]) == (["front"], "front")
        show_both(session)
        session.edit(1, SIGMA, 0.4)
        exact_of_all(session, 1)
    with open_session(client, baked.bake, opening={"resume": hello["resume"]}) as session:
        hello = session.text("hello")
        assert (hello["visible_views"], hello["focused_view"]) == (["front", "left"], "left")
        assert exact_of_all(session, 1)[0].header["view"] == "left"


def test_unsupported_look_is_undone_in_all_views(client: TestClient, baked: Baked, control: Control) -> None:
    control.freeze_gate.set()
    with open_session(client, baked.bake) as session:
        show_both(session)
        session.edit(1, "/environment/rotation", 30.0)
        assert session.text("problem")["revision"] == 1
        session.send_message(type="prepare", curve=THETA_D)
        session.edit(2, SIGMA, 0.4)
        for frame in exact_of_all(session, 2):
            assert np.frombuffer(frame.payload, "<u4")[0] == 900


@pytest.mark.parametrize(
    "message",
    [
        {"type": "views", "names": []},
        {"type": "views", "names": ["front"] * 5},
        {"type": "views", "names": ["front", "nowhere"]},
        {"type": "views", "names": "front"},
        {"type": "views", "names": ["front", "x" * 257]},
        {"type": "focus", "view": "left"},
        {"type": "focus"},
    ],
)
def test_invalid_views_are_rejected(client: TestClient, baked: Baked, message: dict[str, object]) -> None:
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.send_message(**message)
        assert session.text("problem")["problem"]["status"] in (400, 422)
        session.edit(1, SIGMA, 0.3)
        assert session.exact(1).header["view"] == "front"


def test_visible_region_comes_first_and_the_rest_after_the_drag(
    client: TestClient, baked: Baked, control: Control
) -> None:
    control.num_tiles_per_step = 100
    with open_session(client, baked.bake) as session:
        header = session.exact(0).header
        width, height = header["width"], header["height"]
        session.send_message(type="region", view="front", rect=[0, 0, 3, 2])
        session.edit(1, SIGMA, 0.5)
        first, rest = session.frame().header, session.exact(1).header
        assert (first["revision"], first["tiles"][0][:2], first["exact"]) == (1, [0, 0], False)
        assert control.regions == [(0, 0, 3, 2)]
        whole = {(x, y) for x, y, _, _ in [*first["tiles"], *rest["tiles"]]}
        assert len(first["tiles"]) == 1 < len(whole) == len(rest["tiles"]) + 1
        session.send_message(type="region", view="front", rect=None)
        session.edit(2, SIGMA, 0.6)
        assert len(session.exact(2).header["tiles"]) == len(whole)
        for rect in ([width, 0, 1, 1], [0, height, 9, 9]):
            session.send_message(type="region", view="front", rect=rect)
            assert "a region of the image" in session.text("problem")["problem"]["detail"]


def test_hidden_region_is_not_sent_while_a_picture_is_pending(
    client: TestClient, baked: Baked, control: Control
) -> None:
    control.num_tiles_per_step = 100
    with open_session(client, baked.bake) as session:
        num_tiles = len(session.exact(0).header["tiles"])
        session.send_message(type="region", view="front", rect=[0, 0, 3, 2])
        session.edit(1, IOR, 2.0)
        assert session.text("status")["state"] == "precomputing"
        session.edit(2, SIGMA, 0.5)
        frames = [session.frame().header]
        while frames[-1]["revision"] < 2:
            frames.append(session.frame().header)
        time.sleep(0.3)
        control.freeze_gate.set()
        rest = session.frame().header
        assert (frames[-1]["exact"], len(frames[-1]["tiles"])) == (False, 1)
        assert (rest["exact"], len(rest["tiles"])) == (True, num_tiles)
