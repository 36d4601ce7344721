"""Edits that exceed the memory budget are rejected when they arrive, whatever is being precomputed."""

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
def low_memory_client(tmp_path: Path) -> Iterator[TestClient]:
    """Memory for the images and a preview of the still life, but not for an operator of its ball."""
    with TestClient(create_app(Settings(data=tmp_path, allowed_hosts=["testserver"], cache_bytes=400_000))) as client:
        yield client


@pytest.fixture
def bake(low_memory_client: TestClient) -> str:
    bakes, scene = low_memory_client.app.state.services.bakes, still_life()
    register_scene(bakes.data_dir, bakes.ledger, scene)
    bake: str = bakes.submit(scene.id, Recipe("direct", ("front",), (64, 48), 60))
    with bakes.subscribe(bake) as changes:
        assert list(changes)[-1].state == "ready"
    return bake


def answer(session: Session, revision: int) -> None:
    """Wait until an edit is rejected or shown exactly."""
    while True:
        message = session.receive()
        if isinstance(message, dict):
            if message["type"] == "problem" and message["revision"] == revision:
                return
        elif message.header["exact"] and message.header["revision"] == revision:
            return


def test_curve_over_the_budget_during_a_light_rotation_keeps_the_session(
    low_memory_client: TestClient, bake: str
) -> None:
    with open_session(low_memory_client, bake) as session:
        session.exact(0)
        session.send_message(type="prepare", parameter="/environment/rotation")
        session.edit(1, f"{BALL}/curves", {"theta_h": DRAWN})
        answer(session, 1)
        session.edit(2, f"{BALL}/color", [0.2, 0.2, 0.2])
        session.exact(2)


def test_edit_over_the_budget_is_undone_and_the_next_edit_uses_the_previous_look(
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


def test_edit_over_the_budget_of_one_view_is_undone_in_both(client: TestClient, baked: Baked, control: Control) -> None:
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


def test_edit_over_the_budget_is_undone_and_the_previous_look_prepared_again(
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
