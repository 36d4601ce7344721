"""Quotas and rates per user, and the audit log."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from btf_zips import zipped
from fastapi.testclient import TestClient
from server_fakes import SIZE, Control, FakeMethod, write_tiny_scene
from session_client import Baked
from sqlalchemy import update

from relume.store.bake_protocol import Recipe
from relume_server.auth.audit import Audit, Change
from relume_server.auth.rate_limit import TokenBuckets
from relume_server.auth.services import AuthServices
from relume_server.settings import Settings
from relume_worker.database.models import JobRow
from relume_worker.jobs.fair_share import Waiting
from relume_worker.jobs.job import BusyError
from relume_worker.service import BakeService

Bearer = Callable[..., dict[str, str]]
CHANGE = Change("Ann", "edit", "::1", "PUT /api/looks/Red", "/api/looks/Red", 201, "r1")


MESH = "v 0 0 0\nv 2 0 0\nv 2 0.1 -2\nv 0 0 -2\nf 1 2 3 4\n"
SCENE = {"scene": ("triangle.glb", b"which nobody reads")}


@pytest.fixture
def _imports(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    """Importing creates the tiny scene without a separate process."""
    monkeypatch.setattr(client.app.state.services.import_queue.importers, "run", write_tiny_scene)


def test_buckets_refill() -> None:
    now_s = 0.0
    buckets = TokenBuckets(2.0, 3, lambda: now_s)
    assert [buckets.take("Ann") for _ in range(4)] == [0, 0, 0, 0.5]
    assert buckets.take("Bob") == 0
    now_s = 0.5
    assert [buckets.take("Ann"), buckets.take("Ann")] == [0, 0.5]
    now_s = 100.0
    assert [buckets.take("Ann") for _ in range(4)] == [0, 0, 0, 0.5]


def test_number_of_buckets_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relume_server.auth.rate_limit.MAX_BUCKETS", 2)
    buckets = TokenBuckets(1.0, 1, lambda: 0.0)
    assert [buckets.take(name) for name in "abc"] == [0, 0, 0]
    assert (buckets.take("c"), buckets.take("a")) == (1, 0)


class TestRates:
    @pytest.fixture
    def settings(self, settings: Settings) -> Settings:
        settings.requests_per_second, settings.requests_at_once = 0.001, 3
        return settings

    def test_each_user_and_each_address_has_a_bucket(
        self, client: TestClient, bearer: Bearer, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        ann, bob = bearer("edit", "Ann"), bearer("edit", "Bob")
        assert [client.get("/api/me", headers=ann).status_code for _ in range(4)] == [200, 200, 200, 429]
        refused = client.get("/api/me", headers=ann)
        assert int(refused.headers["retry-after"]) > 100
        assert "too many requests; wait" in refused.json()["detail"]
        with monkeypatch.context() as patch:
            patch.setattr(TokenBuckets, "take", lambda *_: 0.001)
            assert "wait 0.1 s" in client.get("/api/me", headers=ann).json()["detail"]
        assert client.get("/api/me", headers=bob).status_code == 200
        wrong = {"Authorization": "Bearer relume_000000000000_x"}
        assert [client.get("/api/me", headers=wrong).status_code for _ in range(4)] == [401, 401, 401, 429]


@pytest.mark.usefixtures("_imports")
class TestBytes:
    @pytest.fixture
    def settings(self, settings: Settings) -> Settings:
        settings.max_bytes_per_user = 100_000
        return settings

    def test_uploads_and_bakes_count_until_they_are_deleted(
        self, client: TestClient, bearer: Bearer, access: AuthServices, settings: Settings
    ) -> None:
        ann, bob = bearer("edit", "Ann"), bearer("edit", "Bob")
        made = client.post("/api/scenes", files=SCENE, headers=ann)
        assert made.status_code == 201, made.text
        scene = made.json()["id"]
        used = access.quotas.used_bytes("Ann")
        on_disk = sum(path.stat().st_size for path in (settings.data / "scenes" / scene).rglob("*") if path.is_file())
        assert used == on_disk > 0
        client.post("/api/scenes", files=SCENE, headers=bob)  # the same recipe scene; Ann owns it
        assert access.quotas.used_bytes("Bob") == 0
        settings.max_bytes_per_user = used
        refused = client.post("/api/scenes", files=SCENE, headers=ann)
        assert refused.status_code == 429
        assert refused.json()["type"] == "urn:relume:problem:quota"
        assert "RELUME_MAX_BYTES_PER_USER" in refused.json()["detail"]
        bake = {"scene": scene, "method": "direct", "size": list(SIZE), "lights": 10}
        assert client.post("/api/bakes", json=bake, headers=ann).status_code == 429
        assert client.post("/api/bakes", json={**bake, "dry_run": True}, headers=ann).status_code == 200
        assert client.delete(f"/api/scenes/{scene}", headers=ann).status_code == 204
        assert access.quotas.used_bytes("Ann") == 0

    def test_finished_fraction_of_stopped_bakes_counts(
        self, client: TestClient, access: AuthServices, baked: Baked
    ) -> None:
        access.quotas.assign_owner("Ann", "bake", baked.bake, 1_000)
        for state, used in (("canceled", 250), ("failed", 250), ("queued", 1_000), ("ready", 77)):
            with client.app.state.services.bakes.ledger.sessions.begin() as session:  # type: ignore[attr-defined]
                changed = {"state": state, "progress": 0.25, "bytes": 77}
                session.execute(update(JobRow).where(JobRow.id == baked.bake).values(changed))
            assert access.quotas.used_bytes("Ann") == used

    def test_unfinished_renders_count_with_their_upper_bound(
        self, client: TestClient, bearer: Bearer, access: AuthServices, settings: Settings, baked: Baked
    ) -> None:
        settings.max_bytes_per_user = 1_000_000
        ann = bearer("edit", "Ann")
        request = {"bake": baked.bake, "view": "front", "looks": [{}], "format": "exr", "size": [16, 16]}
        large = client.post("/api/renders", json={**request, "frames": 3600}, headers=ann)
        assert large.status_code == 429
        assert "render of yours" in large.json()["detail"]
        url = client.post("/api/renders", json=request, headers=ann).headers["location"]
        while client.get(url, headers=ann).json()["state"] != "ready":
            time.sleep(0.01)
        files = (settings.data / "renders" / url.rsplit("/", 1)[1]).iterdir()
        assert access.quotas.used_bytes("Ann") == sum(file.stat().st_size for file in files) > 0
        assert client.delete(url, headers=ann).status_code == 204
        assert access.quotas.used_bytes("Ann") == 0

    def test_comparisons_count_until_their_files_are_deleted(
        self, client: TestClient, bearer: Bearer, control: Control, access: AuthServices, settings: Settings,
        baked: Baked,
    ) -> None:  # fmt: skip
        settings.max_bytes_per_user = 20_000_000
        ann, request = bearer("edit", "Ann"), {"bake": baked.bake, "view": "front", "passes": 4}
        url = client.post("/api/comparisons", json=request, headers=ann).headers["location"]
        planned = access.quotas.used_bytes("Ann")
        settings.max_bytes_per_user = 2 * planned - 1
        refused = client.post("/api/comparisons", json=request, headers=ann)
        assert (refused.status_code, "comparison or render of yours" in refused.json()["detail"]) == (429, True)
        control.trace_gate.set()
        while client.get(url, headers=ann).json()["state"] != "ready":
            time.sleep(0.01)
        files = (settings.data / "comparisons" / url.rsplit("/", 1)[1]).iterdir()
        assert planned > access.quotas.used_bytes("Ann") == sum(file.stat().st_size for file in files) > 0
        assert client.delete(url, headers=ann).status_code == 204  # only stopped
        assert access.quotas.used_bytes("Ann") > 0
        assert client.delete(f"{url}?delete_files=true", headers=ann).status_code == 204
        assert access.quotas.used_bytes("Ann") == 0

    @pytest.mark.parametrize("source", ["synthetic", "geometry"])
    def test_btfs_that_are_rendered_count_with_their_values(
        self, client: TestClient, bearer: Bearer, access: AuthServices, settings: Settings, source: str,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:  # fmt: skip
        monkeypatch.setattr(client.app.state.services.btfs._service, "_claim_next", lambda: False)  # all wait
        values = 81**2 * 8**2 * 3 * 2
        settings.max_bytes_per_user = 2 * values - 1
        ann, url = bearer("edit", "Ann"), f"/api/materials/btf/jobs/{source}"
        body: dict[str, Any] = {"json": {"geometry": "weave", "size": 8}}
        if source == "geometry":
            body = {"files": {"geometry": ("a.obj", MESH)}, "data": {"size": 8}}
        with ThreadPoolExecutor(2) as threads:
            answers = [*threads.map(lambda _: client.post(url, headers=ann, **body), range(2))]
        assert sorted(answer.status_code for answer in answers) == [202, 429]
        assert access.quotas.used_bytes("Ann") == values + (len(MESH) if source == "geometry" else 0)
        (made,) = [answer.headers["location"] for answer in answers if answer.status_code == 202]
        assert client.delete(f"{made}?delete_files=true", headers=ann).status_code == 204
        assert access.quotas.used_bytes("Ann") == 0

    def test_compressed_btf_counts_with_its_stored_size(
        self, client: TestClient, bearer: Bearer, access: AuthServices, settings: Settings, tmp_path: Path
    ) -> None:
        settings.max_bytes_per_user = 1_000_000
        ann, works = bearer("edit", "Ann"), "/api/materials/btf/jobs"
        with zipped(tmp_path / "a.zip").open("rb") as images:
            url = client.post(works, files={"images": ("a.zip", images)}, headers=ann).headers["location"]
        while (body := client.get(url, headers=ann).json())["state"] != "ready":
            assert body["state"] != "failed", body
            time.sleep(0.02)
        failed = client.post(works, files={"images": ("no.zip", b"none")}, headers=ann).headers["location"]
        while client.get(failed, headers=ann).json()["state"] != "failed":
            time.sleep(0.02)
        stored_bytes = sum(file.stat().st_size for file in (settings.data / "btfs" / body["material"]).iterdir())
        assert stored_bytes > 0
        while (
            access.quotas.used_bytes("Ann") != stored_bytes
        ):  # a failed job releases its bytes after its row is updated
            time.sleep(0.02)
        settings.max_bytes_per_user = stored_bytes
        refused = client.post(f"{works}/synthetic", json={"geometry": "weave", "size": 8}, headers=ann)
        assert refused.status_code == 429
        assert client.delete(f"{url}?delete_files=true", headers=ann).status_code == 204
        assert access.quotas.used_bytes("Ann") == stored_bytes
        assert client.delete(f"/api/materials/btf/{body['material']}", headers=ann).status_code == 204
        assert access.quotas.used_bytes("Ann") == 0

    def test_job_has_an_owner_before_it_starts_and_none_if_rejected(
        self,
        client: TestClient,
        bearer: Bearer,
        access: AuthServices,
        settings: Settings,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        settings.max_bytes_per_user = 1_000_000
        owned: list[int] = []

        def refuse(*args: object, **kwargs: object) -> str:
            owned.append(access.quotas.used_bytes("Ann"))
            raise BusyError("100 BTFs are waiting; try again when some are done")

        monkeypatch.setattr(client.app.state.services.btfs, "submit", refuse)
        images = zipped(tmp_path / "a.zip")
        with images.open("rb") as file:
            sent = client.post(
                "/api/materials/btf/jobs", files={"images": ("a.zip", file)}, headers=bearer("edit", "Ann")
            )
        assert sent.status_code == 503
        assert owned == [images.stat().st_size]
        assert access.quotas.used_bytes("Ann") == 0


class TestFairScheduling:
    @pytest.fixture
    def settings(self, settings: Settings) -> Settings:
        settings.fair_shares = {"Cem": 2.0}
        return settings

    def test_bakes_of_two_users_alternate(
        self, client: TestClient, baked: Baked, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        bakes: BakeService = client.app.state.services.bakes
        order: list[str] = []

        def perform(work: Waiting) -> dict[str, float]:
            order.append(names.get(work.id, ""))
            return {}

        monkeypatch.setattr(bakes.kind, "perform", perform)
        claimable = bakes.ledger.claimable
        monkeypatch.setattr(bakes.ledger, "claimable", lambda kinds, running: [])
        names: dict[str, str] = {}
        for k, name in enumerate(["Ann"] * 4 + ["Bob"] * 2 + ["Cem"] * 4):
            names[bakes.submit(baked.scene, Recipe("direct", ("front",), SIZE, 11 + k), name)] = name
        assert [bakes.get(bake).queue_position for bake in names] == [0, 3, 6, 8, 1, 4, 2, 5, 7, 9]
        monkeypatch.setattr(bakes.ledger, "claimable", claimable)
        while len(order) < 10:
            time.sleep(0.01)
        assert order[:8].count("Cem") == 4
        assert order[:8].count("Bob") == order[:8].count("Ann") == 2


@pytest.mark.usefixtures("_imports")
class TestBakes:
    @pytest.fixture
    def settings(self, settings: Settings) -> Settings:
        settings.max_bakes_per_user = 1
        return settings

    @pytest.fixture
    def gate(self, monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
        gate = threading.Event()
        held = FakeMethod(gate)
        monkeypatch.setattr("server_fixtures.FakeMethod", lambda: held)
        yield gate
        gate.set()

    def test_running_bakes_per_user_are_limited(
        self, gate: threading.Event, client: TestClient, bearer: Bearer
    ) -> None:
        ann, bob = bearer("edit", "Ann"), bearer("edit", "Bob")
        scene = client.post("/api/example-scenes/cornell_box", headers=ann).json()["id"]
        recipes = [{"scene": scene, "method": "direct", "size": list(SIZE), "lights": lights} for lights in (10, 20)]
        first = client.post("/api/bakes", json=recipes[0], headers=ann)
        assert first.status_code == 202, first.text
        assert client.post("/api/bakes", json=recipes[0], headers=ann).status_code == 202  # the same recipe
        refused = client.post("/api/bakes", json=recipes[1], headers=ann)
        assert refused.status_code == 429
        assert "RELUME_MAX_BAKES_PER_USER" in refused.json()["detail"]
        assert client.post("/api/bakes", json=recipes[1], headers=bob).status_code == 202
        gate.set()
        bakes: BakeService = client.app.state.services.bakes
        with bakes.subscribe(first.json()["id"]) as changes:
            list(changes)
        third = {**recipes[0], "lights": 30}
        assert client.post("/api/bakes", json=third, headers=ann).status_code == 202


class TestQueues:
    @pytest.fixture
    def settings(self, settings: Settings) -> Settings:
        settings.max_queued = 8
        return settings

    def test_one_user_fills_at_most_a_quarter_of_a_queue(
        self, client: TestClient, bearer: Bearer, baked: Baked, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(client.app.state.services.renders._service, "_claim_next", lambda: False)  # all wait
        request = {"bake": baked.bake, "view": "front", "looks": [{}], "format": "png"}
        ann, bob = bearer("edit", "Ann"), bearer("edit", "Bob")
        answers = [client.post("/api/renders", json=request, headers=who) for who in (ann, ann, ann, bob)]
        assert [answer.status_code for answer in answers] == [202, 202, 429, 202]
        assert "limit of 2 unfinished renders; " in answers[2].json()["detail"]


def test_anonymous_users_share_one_client_that_may_fill_a_queue() -> None:
    assert Settings(max_queued=8).max_queued_per_client == 8
    assert Settings(max_queued=8, login=True).max_queued_per_client == 2
    assert Settings(max_queued=8, max_queued_per_user=3).max_queued_per_client == 3


def test_each_change_and_each_rejection_is_an_audit_line(client: TestClient, bearer: Bearer, baked: Baked) -> None:
    ann, root, viewer = bearer("edit", "Ann"), bearer("admin", "Root"), bearer("view")
    client.put("/api/looks/Red", json={}, headers={**ann, "X-Request-ID": "abc-1"})
    client.put("/api/looks/Red", json={}, headers=ann)  # rejected: no version given
    client.put("/api/looks/Red", json={}, headers=viewer)  # rejected
    client.get("/api/looks", headers=ann)
    client.post("/api/bakes", json={"scene": baked.scene, "dry_run": True}, headers=ann)
    request = {"bake": baked.bake, "view": "front", "views": ["front"], "look": {}}
    share = client.post("/api/shares", json=request, headers=ann).json()["id"]
    client.delete("/api/looks/Red", headers={**ann, "If-Match": "*"})
    lines = client.get("/api/audit", headers=root).json()
    (refused,) = [line for line in lines if line["status"] == 403]
    assert (refused["who"], refused["what"]) == ("view", "PUT /api/looks/Red")
    lines.remove(refused)
    assert [(line["what"], line["object"], line["status"]) for line in lines] == [
        ("DELETE /api/looks/Red", "/api/looks/Red", 204),
        ("POST /api/shares", f"/api/shares/{share}", 201),
        ("PUT /api/looks/Red", "/api/looks/Red", 201),
    ]
    assert {(line["who"], line["role"], line["address"]) for line in lines} == {("Ann", "edit", "testclient")}
    assert lines[2]["request"] == "abc-1"
    assert lines[0]["request"] not in ("", "abc-1")
    before = lines[0]["number"]
    assert len(client.get(f"/api/audit?before={before}&limit=1", headers=root).json()) == 1
    assert client.get("/api/audit?who=Bob", headers=root).json() == []


def test_the_audit_is_bounded(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relume_server.auth.audit._TRIM_EVERY", 2)
    audit = Audit(client.app.state.services.looks._sessions, 5)
    for _ in range(20):
        audit.add(CHANGE)
    lines = audit.list(100)
    assert 5 <= len(lines) <= 5 + 3
    assert [line.number for line in lines] == list(range(20, 20 - len(lines), -1))


def test_request_ids_are_generated_or_accepted(client: TestClient) -> None:
    assert client.get("/livez", headers={"X-Request-ID": "from.proxy-7"}).headers["x-request-id"] == "from.proxy-7"
    first_id, second_id = (
        client.get("/livez", headers={"X-Request-ID": "ev il\n"}).headers["x-request-id"] for _ in range(2)
    )
    assert len(first_id) == 16
    assert first_id != second_id
