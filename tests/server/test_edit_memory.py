"""Edits that need more memory than there is: refused when they come, whatever is being made meanwhile."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from fastapi.testclient import TestClient
from server_fakes import Control
from session_client import IOR, SIGMA, Baked, Session, open_session
from tiny_scenes import still_life

from relume.store.bake_protocol import Recipe
from relume_server.app import create_app
from relume_server.settings import Settings
from relume_worker.scenes import register_scene

BALL = "/materials/Ball/terms/1"
DRAWN = {"points": [[0, 1], [90, 0]]}


@pytest.fixture
def short(tmp_path: Path) -> Iterator[TestClient]:
    """Memory for the images and a preview of the still life, for no operator of its ball."""
    with TestClient(create_app(Settings(data=tmp_path, allowed_hosts=["testserver"], cache_bytes=400_000))) as client:
        yield client


@pytest.fixture
def bake(short: TestClient) -> str:
    bakes, scene = short.app.state.services.bakes, still_life()
    register_scene(bakes.data_dir, bakes.ledger, scene)
    bake: str = bakes.submit(scene.id, Recipe("direct", ("front",), (64, 48), 60))
    with bakes.subscribe(bake) as changes:
        assert list(changes)[-1].state == "ready"
    return bake


def answer(session: Session, revision: int) -> None:
    """Wait until an edit is refused or shown exactly."""
    while True:
        message = session.receive()
        if isinstance(message, dict):
            if message["type"] == "problem" and message["revision"] == revision:
                return
        elif message.header["exact"] and message.header["revision"] == revision:
            return


def test_curve_over_the_budget_while_a_turned_light_is_prepared_does_not_end_the_session(
    short: TestClient, bake: str
) -> None:
    with open_session(short, bake) as session:
        session.exact(0)
        session.send_message(type="prepare", parameter="/environment/rotation")
        session.edit(1, f"{BALL}/curves", {"theta_h": DRAWN})
        answer(session, 1)
        session.edit(2, f"{BALL}/color", [0.2, 0.2, 0.2])
        session.exact(2)


def test_edit_that_needs_too_much_memory_is_taken_back_and_the_next_one_builds_on_the_look_before(
    client: TestClient, baked: Baked, control: Control
) -> None:
    control.views_over_budget = {"front"}
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.edit(1, IOR, 2.0)
        problem = session.text("problem")
        assert (problem["revision"], problem["problem"]["type"]) == (1, "urn:relume:problem:memory-budget")
        session.edit(2, SIGMA, 0.4)
        assert np.frombuffer(session.exact(2).payload, "<u4")[0] == 900
    assert not control.freeze_started.is_set()


def test_edit_that_one_of_two_views_has_no_memory_for_is_taken_back_in_both(
    client: TestClient, baked: Baked, control: Control
) -> None:
    control.views_over_budget = {"left"}
    with open_session(client, baked.bake) as session:
        session.send_message(type="views", names=["front", "left"])
        for _ in range(2):
            session.exact(0)
        session.edit(1, IOR, 2.0)
        assert session.text("problem")["revision"] == 1
        session.edit(2, SIGMA, 0.4)
        shown = [session.exact(2) for _ in range(2)]
        assert {frame.header["view"] for frame in shown} == {"front", "left"}
        assert all(np.frombuffer(frame.payload, "<u4")[0] == 900 for frame in shown)


def test_edit_too_large_that_a_hand_prepares_for_is_taken_back_and_prepared_for_the_look_before(
    client: TestClient, baked: Baked, control: Control
) -> None:
    control.views_over_budget = {"front"}
    with open_session(client, baked.bake) as session:
        session.exact(0)
        session.edit(1, IOR, 2.0)
        session.send_message(type="prepare", parameter=SIGMA)
        refused = [session.text("problem")["revision"] for _ in range(2)]
        assert refused == [1, None]
        session.edit(2, SIGMA, 0.4)
        session.exact(2)
