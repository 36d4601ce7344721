"""Lists: pagination, filters, and rejection of unknown query parameters."""

from typing import Any

import pytest
from fastapi.routing import APIRoute
from fastapi.testclient import TestClient
from problems import parse_problem
from server_fakes import SIZE, tiny_scene
from session_client import Baked
from test_comparisons import is_done, wait_until

from relume.store.bake_protocol import Recipe
from relume_server.app import ROUTE_GROUPS
from relume_worker.scenes import register_scene

LOOK = {"display": {"exposure": 1.0}}


def lists() -> list[str]:
    """Addresses of all calls that return a list."""
    routes = [route for group in ROUTE_GROUPS for route in group.router.routes if isinstance(route, APIRoute)]
    return [route.path for route in routes if "GET" in route.methods and "list[" in str(route.response_model)]


@pytest.fixture
def filled(client: TestClient, baked: Baked) -> Baked:
    """At least three entries of each kind that needs no uploaded file."""
    services = client.app.state.services
    for name in "bcd":
        register_scene(services.bakes.data_dir, services.bakes.ledger, tiny_scene(name))
    for lights in (11, 12):
        bake = services.bakes.submit(baked.scene, Recipe("direct", ("front",), SIZE, lights))
        with services.bakes.subscribe(bake) as changes:
            list(changes)
    camera = {"to_world": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 5, 0, 0, 0, 1], "yfov": 40}
    pin = {"bake": baked.bake, "view": "front", "x": 1, "y": 2, "size": list(SIZE)}
    for name in "abc":
        assert client.put(f"/api/looks/{name}", json=LOOK).status_code == 201
        assert client.put(f"/api/scenes/{baked.scene}/cameras/{name}", json=camera).status_code == 201
        assert client.post(f"/api/scenes/{baked.scene}/comments", json={**pin, "text": name}).status_code == 201
        look = {"display": {"exposure": float(ord(name) % 7)}}
        shared = {"bake": baked.bake, "view": "front", "views": ["front"], "look": look}
        assert client.post("/api/shares", json=shared).status_code == 201
        render = {"bake": baked.bake, "view": "front", "format": "png", "looks": [{}], "name": name}
        wait_until(client, client.post("/api/renders", json=render).headers["location"], is_done)
        comparison = {"bake": baked.bake, "view": "front", "passes": 2}
        stopped = client.post("/api/comparisons", json=comparison).headers["location"]
        assert client.delete(stopped).status_code == 204
    return baked


def in_pages(client: TestClient, url: str, limit: int) -> list[Any]:
    entries: list[Any] = []
    following: str | None = f"{url}?limit={limit}"
    while following is not None:
        answer = client.get(following)
        assert answer.status_code == 200, answer.text
        assert 0 < len(answer.json()) <= limit
        entries += answer.json()
        following = answer.links["next"]["url"] if "next" in answer.links else None
    return entries


def test_pages_of_every_list_are_complete(client: TestClient, filled: Baked) -> None:
    paths = lists()
    assert {"/api/scenes", "/api/bakes", "/api/renders", "/api/comparisons", "/api/looks", "/api/shares"} <= set(paths)
    for path in paths:
        url = path.replace("{scene}", filled.scene)
        if "{" in url or path in ("/api/audit", "/api/materials/map/at"):  # paged by number; terms of one material
            continue
        whole = client.get(url).json()
        if whole:
            assert in_pages(client, url, 2) == whole, url
        assert "link" not in client.get(url).headers
        for query, said in (("limit=0", "limit"), ("after=nonsense", "after"), ("limitt=1", "limitt")):
            answer = client.get(f"{url}?{query}")
            assert answer.status_code == 422, (url, query)
            assert said in answer.text
        of_another = client.get(f"{url}?after=WyJ4Il0")
        assert of_another.status_code in ((422,) if whole else (200, 422)), url


def test_pages_are_stable_during_deletion(client: TestClient, filled: Baked) -> None:
    first = client.get("/api/looks?limit=2")
    names = [look["name"] for look in first.json()]
    assert client.delete(f"/api/looks/{names[-1]}", headers={"If-Match": "*"}).status_code == 204
    rest = client.get(first.links["next"]["url"]).json()
    assert sorted([*names, *(look["name"] for look in rest)]) == ["a", "b", "c"]


def test_filters(client: TestClient, filled: Baked) -> None:
    def ids(url: str) -> list[str]:
        return [entry.get("name", entry["id"]) for entry in client.get(url).json()]

    assert ids("/api/renders?name=b") == ["b"]
    assert ids("/api/renders?state=ready&limit=2") == ["c", "b"]
    assert ids(f"/api/renders?bake={filled.bake}&user=") == ["c", "b", "a"]
    for none in ("state=queued", f"bake={'0' * 16}", "user=ann"):
        assert ids(f"/api/renders?{none}") == []
    assert len(ids("/api/comparisons?state=canceled")) == 3
    assert len(ids(f"/api/bakes?state=ready&scene={filled.scene}&user=")) == 3
    assert ids("/api/bakes?state=failed") == []
    assert ids("/api/scenes?name=c") == ["c"]
    assert len(ids(f"/api/shares?bake={filled.bake}")) == 3
    assert client.get(f"/api/scenes/{filled.scene}/comments?resolved=true").json() == []
    assert len(client.get(f"/api/scenes/{filled.scene}/comments?resolved=false").json()) == 3
    assert parse_problem(client.get("/api/renders?state=done"))["detail"].startswith("state is 'done'; give 'queued'")


def test_jobs_have_an_owner_and_times(client: TestClient, filled: Baked) -> None:
    render = client.get("/api/renders?name=a").json()[0]
    assert (render["user"], render["name"], render["state"]) == ("", "a", "ready")
    assert render["created"] <= render["started"] <= render["ended"]
    comparison = client.get("/api/comparisons").json()[0]
    assert comparison["state"] == "canceled"
    assert comparison["ended"] is not None
    assert all(bake["created"] and bake["user"] == "" for bake in client.get("/api/bakes").json())


@pytest.mark.parametrize("url", ["/api/bakes?stat=ready", "/api/me?x=1", "/api/color?limit=3"])
def test_unknown_query_parameters_are_rejected_by_name(client: TestClient, url: str) -> None:
    answer = client.get(url)
    problem = parse_problem(answer)
    assert answer.status_code == 422
    assert url.partition("?")[2].partition("=")[0] in problem["detail"]
