"""Sessions of the client: images of edits, rejected edits, lost connections."""

from __future__ import annotations

import signal

import numpy as np
import pytest
from coroutines import run_in_thread
from running_server import Running, running_server
from server_fakes import SIZE, Control

from relume.image_io.tone_mapping import tone_map
from relume.image_io.write_image import to_bytes
from relume_client import (
    AsyncClient,
    Bake,
    Client,
    EditRejectedError,
    ProblemError,
    ServerUnavailableError,
    ServerVersionError,
)
from relume_server.settings import Settings

WIDTH, HEIGHT = SIZE


def displayed(radiance: float, exposure: float = 0.0) -> np.ndarray:
    """The image that the fake library shows: the diffuse color plus sigma, everywhere."""
    return to_bytes(tone_map(np.full((HEIGHT, WIDTH, 3), radiance, np.float32), exposure, "agx"))


def test_frame_shows_all_edits(bake: Bake) -> None:
    with bake.session() as session:
        assert np.array_equal(session.frame(), displayed(0.5 + 0.2))
        session["Paper"].sigma = 0.4
        session["Paper"].lambert.color = np.full(3, 0.1)
        image = session.frame(exact=True)
        assert (image.dtype, image.shape) == (np.uint8, (HEIGHT, WIDTH, 3))
        assert np.array_equal(image, displayed(0.5))
        session.look.display.exposure = 1.0
        assert np.array_equal(session.frame(exact=False), displayed(0.5, 1.0))
        assert session.status == "exact"


def test_linear_frames_are_decoded(bake: Bake) -> None:
    """The fake server sends round(1000 · radiance) as the word of each pixel, so that exponents are zero."""
    with bake.session() as session:
        session["Paper"].sigma = 0.1
        session["Paper"].lambert.color = 0.2, 0.2, 0.2
        image = session.frame(linear=True)
        assert (image.dtype, image.shape) == (np.float32, (HEIGHT, WIDTH, 3))
        assert np.array_equal(image, np.full((HEIGHT, WIDTH, 1), 300 * 2.0**-24) * [1, 0, 0])
        assert np.array_equal(session.frame(), displayed(0.3))


def test_rejected_edit_raises_the_sentence_of_the_server_and_the_session_goes_on(bake: Bake) -> None:
    with bake.session() as session:
        session["Paper"].sigma = 0.3
        session.frame()
        before = session.look.to_document()
        session["Paper"].lambert.color = 0.5, -1.0, 0.5
        with pytest.raises(EditRejectedError, match=r"/materials/Paper/terms/0/color/1 is -1\.0; give a number"):
            session.frame()
        assert session.look.to_document() == before
        assert np.array_equal(session.frame(), displayed(0.8))
        session["Paper"].sigma = 0.1
        assert np.array_equal(session.frame(), displayed(0.6))


def test_edit_that_the_bake_cannot_show_is_reverted(bake: Bake) -> None:
    with bake.session() as session:
        session["Paper"].sigma = 0.3
        session.frame()
        session.look.environment.rotation = 45
        with pytest.raises(EditRejectedError, match="the environment's rotation"):
            session.frame()
        assert session.look.environment.rotation == 0
        assert np.array_equal(session.frame(), displayed(0.8))


def test_first_edit_that_ends_the_connection_is_reverted(bake: Bake) -> None:
    with bake.session() as session:
        session.look.environment.rotation = 45  # before the first image, which the server needs to go back to
        with pytest.raises(EditRejectedError, match="the environment's rotation"):
            session.frame()
        session["Paper"].sigma = 0.3
        assert np.array_equal(session.frame(), displayed(0.8))


def test_many_edits_are_merged(bake: Bake, control: Control) -> None:
    with bake.session() as session:
        session.frame()
        looks_before = control.num_looks
        for sigma in np.linspace(0.1, 0.4, 1001):
            session["Paper"].sigma = sigma
        assert np.array_equal(session.frame(), displayed(0.9))
        assert control.num_looks - looks_before < 500


def test_session_goes_on_after_a_restart(settings: Settings, control: Control) -> None:
    settings.drain_seconds = 60.0
    with running_server(settings, control) as running:
        client = Client(f"http://127.0.0.1:{running.port}")
        session = client.bake(running.bake()).session().__enter__()
        session["Paper"].sigma = 0.4
        session.frame()
        running.process.handle_exit(signal.SIGTERM, None)
    session["Paper"].lambert.color = 0.1, 0.1, 0.1  # while the server is away
    with pytest.raises(ServerUnavailableError, match=r"no exact image within 0.2 s: the server .* is not available"):
        session.frame(timeout=0.2)
    assert session.status == "connecting"
    with running_server(settings, control, running.port):
        assert np.array_equal(session.frame(), displayed(0.5))
        session["Paper"].sigma = 0.2
        assert np.array_equal(session.frame(), displayed(0.3))
        session.close()
        client.close()


def test_deleted_bake_ends_the_session(bake: Bake, client: Client) -> None:
    with bake.session() as session:
        session.frame()
    bake.delete()
    with pytest.raises(ProblemError, match="bake") as refused, bake.session():
        pass
    assert refused.value.kind == "not-found"


def test_unknown_view_names_the_views(bake: Bake) -> None:
    with pytest.raises(ProblemError, match="no view 'top'; it has front"), bake.session(view="top"):
        pass
    with bake.session(view="front") as session:
        assert session.view["name"] == "front"
        assert np.array_equal(session.frame(), displayed(0.7))


def test_other_version_of_the_protocol(bake: Bake, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relume_client.session_socket.SUBPROTOCOL", "relume.v999")
    with pytest.raises(ServerVersionError, match=r"this server speaks relume\.v2"), bake.session():
        pass


def test_missing_image_says_what_the_server_does(bake: Bake, control: Control) -> None:
    with bake.session() as session:
        session.frame()
        control.freeze_gate.clear()
        session["Paper"].ior = 1.7  # needs an operator that waits for the gate
        with pytest.raises(TimeoutError, match=r"no exact image within 0.5 s: precomputing Paper, theta_d"):
            session.frame(timeout=0.5)
        control.freeze_gate.set()
        assert np.array_equal(session.frame(), displayed(0.9))


def test_fixed_cameras_do_not_move(bake: Bake) -> None:
    with bake.session() as session, pytest.raises(ValueError, match="bake with the method 'probes'"):
        session.move_camera(np.eye(4))


def test_listeners_get_frames_until_they_leave(bake: Bake) -> None:
    with bake.session() as session:
        revisions = list[int]()
        leave = session.subscribe(lambda frame: revisions.append(frame.header["revision"]) if frame else None)
        session["Paper"].sigma = 0.4
        session.frame()
        leave()
        session["Paper"].sigma = 0.2
        session.frame()
    assert revisions[-1] == 1


def test_async_session(running: Running) -> None:
    identity = running.bake()

    async def work() -> np.ndarray:
        async with AsyncClient(f"http://127.0.0.1:{running.port}") as client:
            bake = await client.bake(identity)
            async with bake.session() as session:
                session["Paper"].sigma = 0.4
                return await session.frame(exact=True)

    assert np.array_equal(run_in_thread(work()), displayed(0.9))
