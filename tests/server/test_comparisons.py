"""Comparisons with the reference over REST: figures, images, restart, deletion and invalid requests."""

import io
import threading
import time
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest
from fastapi.testclient import TestClient
from PIL import Image
from server_fakes import SIZE, Control, FakeTransfer, InThreadSteps
from session_client import Baked

from relume.core.errors import CancelledError
from relume.live.fixed_camera.protocols import CameraMode
from relume_server.app import create_app
from relume_server.batch.step_registry import STEPS
from relume_server.jobs.comparison_jobs import DEFAULT_PIXEL_S
from relume_server.settings import Settings
from relume_worker.database.models import JobRow

WAIT_S = 60.0


def wait_until(client: TestClient, url: str, is_reached: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    deadline = time.monotonic() + WAIT_S
    while time.monotonic() < deadline:
        body: dict[str, Any] = client.get(url).json()
        if is_reached(body):
            return body
        time.sleep(0.02)
    raise TimeoutError(url)


def is_done(body: dict[str, Any]) -> bool:
    return body["state"] in ("ready", "failed")


def submit(client: TestClient, baked: Baked, passes: int, **more: Any) -> str:
    queued = client.post("/api/comparisons", json={"bake": baked.bake, "view": "front", "passes": passes, **more})
    assert queued.status_code == 202, queued.text
    return str(queued.headers["location"])


def test_comparison_measures_and_shows_the_error(client: TestClient, control: Control, baked: Baked) -> None:
    control.trace_gate.set()
    url = submit(client, baked, 6)
    body = wait_until(client, url, is_done)
    assert (body["state"], body["completed"], body["progress"]) == ("ready", 6, 1.0)
    # the fake reference is the frame's pixel / 1.1 with noise of 1/50; with all paths, three quarters of the pixel
    assert (body["paths"], body["omitted_paths"], body["unsupported_paths"]) == ("all", ["What surfaces reflect."], [])
    assert body["error_all_paths"]["error"] == pytest.approx(1 / 3, rel=0.02)
    method_error = body["error_method_paths"]
    assert method_error["error"] == pytest.approx(0.1, rel=0.02)
    assert 0 < method_error["standard_error"] < 0.001
    assert method_error["error"] < method_error["error_upper_bound"] < 0.11
    assert method_error["noise"] == pytest.approx(0.02 / np.sqrt(6), rel=0.05)
    assert method_error["significant_pixel_fraction"] > 0.99
    for prefix in ("", "method-"):
        error = np.asarray(Image.open(io.BytesIO(client.get(f"{url}/{prefix}error.png").content)), int)
        assert error.shape == (SIZE[1], SIZE[0], 3)
        assert np.mean(error[..., 0] > error[..., 2] + 20) > 0.99  # too bright
    whole, followed = (_brightness(client, f"{url}/{name}.png") for name in ("reference", "method-reference"))
    assert whole < followed - 4  # in units of 1/255
    assert client.get(f"{url}/other.png").status_code == 422


def _brightness(client: TestClient, url: str) -> float:
    image = Image.open(io.BytesIO(client.get(url).content))
    assert image.size == SIZE
    return float(np.asarray(image).mean())


def test_comparison_may_trace_only_method_paths(client: TestClient, control: Control, baked: Baked) -> None:
    control.trace_gate.set()
    url = submit(client, baked, 4, paths="method")
    body = wait_until(client, url, is_done)
    assert body["paths"] == "method"
    assert body["error_all_paths"] is None
    assert body["error_method_paths"]["error"] == pytest.approx(0.1, rel=0.02)
    assert body["omitted_paths"] == ["What surfaces reflect."]
    assert _brightness(client, f"{url}/reference.png") == _brightness(client, f"{url}/method-reference.png")


@pytest.mark.parametrize(("is_upgraded", "asked"), [(False, [3, 4]), (True, [0, 0, 1, 2, 3, 4])])
def test_comparison_resumes_after_a_restart_and_restarts_after_an_upgrade(
    settings: Settings,
    client: TestClient,
    control: Control,
    baked: Baked,
    monkeypatch: pytest.MonkeyPatch,
    is_upgraded: bool,
    asked: list[int],
) -> None:
    control.trace_gate.set()
    url = submit(client, baked, 3)
    assert wait_until(client, url, is_done)["state"] == "ready"
    comparisons = client.app.state.services.comparisons
    identity = url.rsplit("/", 1)[1]
    request = comparisons.get(identity).request.model_copy(update={"passes": 5}).model_dump_json()
    comparisons._service.close()  # otherwise it might take the job first
    # the state after a kill in the fourth pass
    comparisons._service.ledger._update(JobRow.id == identity, state="running", request=request)
    if is_upgraded:
        monkeypatch.setattr("relume_server.batch.reference_passes.comparison_code", lambda: "0123456789abcdef")
    later = Control()
    later.trace_gate.set()
    with TestClient(create_app(settings, open_library=later.open_library, open_steps=InThreadSteps)) as restarted:
        assert wait_until(restarted, url, is_done)["completed"] == 5
    assert later.requested_passes == asked


def test_deletion_stops_the_job_and_deletes_its_files(client: TestClient, control: Control, baked: Baked) -> None:
    url = submit(client, baked, 1000)
    wait_until(client, url, lambda body: body["state"] == "running")
    assert client.get(f"{url}/error.png").status_code == 409
    assert client.delete(url, params={"delete_files": True}).status_code == 204
    assert client.get(url).status_code == 404
    control.trace_gate.set()  # the next job runs
    assert wait_until(client, submit(client, baked, 2), is_done)["state"] == "ready"
    folder = client.app.state.services.settings.data / "comparisons"
    assert len(list(folder.iterdir())) == 1


def test_stopped_comparison_keeps_its_result_and_resumes(client: TestClient, control: Control, baked: Baked) -> None:
    control.trace_gate.set()
    url = submit(client, baked, 1000)
    wait_until(client, url, lambda body: body["completed"] >= 3 and body["error_all_paths"] is not None)
    assert client.delete(url).status_code == 204
    stopped = client.get(url).json()
    assert (stopped["state"], stopped["seconds_left"]) == ("stopped", None)
    assert stopped["error_all_paths"]["noise"] > 0
    assert client.get(f"{url}/error.png").status_code == 200
    assert client.delete(url).status_code == 204  # again: nothing left to stop
    assert wait_until(client, submit(client, baked, 2), is_done)["state"] == "ready"  # the next job runs
    passes = client.get(url).json()["completed"]
    resumed = client.post(f"{url}/resume")
    assert resumed.status_code == 202
    assert resumed.json()["state"] in ("queued", "running")  # the queue may be faster than the response
    on = wait_until(client, url, lambda body: body["completed"] > passes + 1)
    assert on["seconds_left"] > 0
    whole = [
        index for index, (_, size) in zip(control.requested_passes, control.pass_cameras, strict=False) if size == SIZE
    ]
    assert len(whole) - len(set(whole)) <= 3  # no finished pass was repeated
    assert client.delete(url, params={"delete_files": True}).status_code == 204
    assert client.post(f"{url}/resume").status_code == 404


def test_duration_is_estimated_before_the_start(client: TestClient, control: Control, baked: Baked) -> None:
    control.trace_gate.set()
    request = {"bake": baked.bake, "view": "front", "passes": 10, "dry_run": True}
    planned = client.post("/api/comparisons", json=request)
    assert planned.status_code == 200
    assert planned.json()["passes"] == 10
    assert planned.json()["seconds"] > 0
    assert len(control.requested_passes) == 1  # one small picture; the second estimate reuses its rate
    again = client.post("/api/comparisons", json=request | {"passes": 20}).json()
    assert again["seconds"] == pytest.approx(2 * planned.json()["seconds"])
    assert len(control.requested_passes) == 1
    assert client.post("/api/comparisons", json=request | {"view": "nowhere"}).status_code == 422


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({"bake": "0" * 16}, 404),
        ({"view": "nowhere"}, 422),
        ({"passes": 1}, 422),
        ({"passes": 10**9}, 422),
        ({"look": {"materials": {"Nobody": {"terms": []}}}}, 422),
        ({"spp": 5}, 422),
        ({"paths": "some"}, 422),
        ({"camera": {"to_world": np.eye(4).ravel().tolist(), "yfov": 40}}, 422),  # the view has a fixed camera
        ({"size": [80, 60]}, 422),
    ],
)
def test_bad_request_is_refused(client: TestClient, baked: Baked, change: dict[str, Any], status: int) -> None:
    request = {"bake": baked.bake, "view": "front"} | change
    answer = client.post("/api/comparisons", json=request)
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("method", ["direct", "gather"])
def test_reference_traces_the_light_paths_of_the_bake(
    client: TestClient, control: Control, baked: Baked, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    monkeypatch.setattr(FakeTransfer, "__init__", _baked_by(method, FakeTransfer.__init__))
    control.trace_gate.set()
    wait_until(client, submit(client, baked, 2), is_done)
    assert control.requested_reflections == [method == "gather"] * 3  # a small estimate and two passes


def _baked_by(method: str, init: Callable[..., None], **also: Any) -> Callable[..., None]:
    return lambda self, *args, **more: init(self, *args, **{**more, "method": method, **also})


def test_free_camera_view_is_compared_from_its_camera(
    client: TestClient, control: Control, baked: Baked, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        FakeTransfer, "__init__", _baked_by("probes", FakeTransfer.__init__, camera_mode=CameraMode.FREE)
    )
    control.trace_gate.set()
    to_world = np.array([[0, 0, 1, 4], [0, 1, 0, 2], [-1, 0, 0, 3], [0, 0, 0, 1]], float)
    camera = {"to_world": to_world.ravel().tolist(), "yfov": 40.0}
    url = submit(client, baked, 2, camera=camera, size=[40, 24])
    assert wait_until(client, url, is_done)["state"] == "ready"
    assert Image.open(io.BytesIO(client.get(f"{url}/error.png").content)).size == (40, 24)
    (frame_from,) = [pose for pose in control.frame_cameras if pose is not None]
    for pose_of_pass, size in (frame_from, *control.pass_cameras):
        assert size == (40, 24)  # smaller ones are rendered larger first
        assert np.array_equal(pose_of_pass.to_world, to_world)
        assert pose_of_pass.yfov == pytest.approx(np.radians(40))
    request = {"bake": baked.bake, "view": "front", "camera": camera}
    for change in (
        {"size": [16384, 16384]},
        {"camera": camera | {"yfov": 180.0}},
        {"camera": camera | {"to_world": [0.0] * 16}},
    ):
        refused = client.post("/api/comparisons", json=request | change)
        assert refused.status_code == 422, refused.text


def test_estimates_do_not_queue_and_use_other_views_until_timed(
    client: TestClient, control: Control, baked: Baked, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("relume_server.jobs.comparison_jobs.ANSWER_S", 0.01)
    question = {"bake": baked.bake, "view": "front", "passes": 4, "dry_run": True}
    guessed = client.post("/api/comparisons", json=question)  # no tracing is allowed
    assert (guessed.status_code, guessed.json()["is_measured"]) == (200, False)
    assert guessed.json()["seconds"] == pytest.approx(4 * DEFAULT_PIXEL_S * SIZE[0] * SIZE[1])
    assert client.post("/api/comparisons", json=question | {"paths": "method"}).json()["is_measured"] is False
    control.trace_gate.set()
    client.app.state.services.comparisons._sample.result(WAIT_S)  # type: ignore[attr-defined]
    measured = client.post("/api/comparisons", json=question).json()
    assert measured["is_measured"] is True
    assert client.post("/api/comparisons", json=question).json() == measured
    assert len(control.requested_passes) == 1


def test_image_and_progress_exist_during_the_first_pass(
    client: TestClient, control: Control, baked: Baked, monkeypatch: pytest.MonkeyPatch
) -> None:
    half_way = threading.Event()

    def slow(shop: Any, tell: Callable[[float], None], is_canceled: Callable[[], bool], **_: Any) -> None:
        tell(0.5)
        half_way.set()
        while not is_canceled():
            time.sleep(0.01)
        raise CancelledError("stopped")

    monkeypatch.setitem(cast("dict[str, Any]", STEPS), "pass of a comparison", slow)
    control.trace_gate.set()
    url = submit(client, baked, 2)
    assert half_way.wait(WAIT_S)
    body = client.get(url).json()
    assert (body["completed"], body["progress"], body["error_all_paths"]) == (0, 0.25, None)
    for prefix in ("", "method-"):
        picture = Image.open(io.BytesIO(client.get(f"{url}/{prefix}reference.png").content))
        assert picture.size == (SIZE[0] // 4, SIZE[1] // 4)
        assert client.get(f"{url}/{prefix}error.png").status_code == 409
    client.delete(url)


def test_reference_image_exists_after_one_pass(client: TestClient, control: Control, baked: Baked) -> None:
    control.trace_gate.set()
    make_pass, passes = STEPS["pass of a comparison"], list[int]()

    def once(context: Any, report: Any, is_canceled: Callable[[], bool], **values: Any) -> Any:
        passes.append(0)
        if len(passes) == 1:
            return make_pass(context, report, is_canceled, **values)
        while not is_canceled():
            time.sleep(0.01)
        raise CancelledError("one is enough")

    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(cast("dict[str, Any]", STEPS), "pass of a comparison", once)
        url = submit(client, baked, 1000)
        wait_until(client, url, lambda body: body["completed"] == 1)
        assert Image.open(io.BytesIO(client.get(f"{url}/reference.png").content)).size == SIZE
        assert client.get(f"{url}/error.png").status_code == 409
        client.delete(url)
