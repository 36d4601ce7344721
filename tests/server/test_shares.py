"""Share links: the look is validated, bounded and immutable."""

import re
from typing import Any

import pytest
from fastapi.testclient import TestClient
from problems import parse_problem
from server_fakes import tiny_scene
from session_client import Baked

from relume.look import default_look
from relume_server.persistence import share_store
from relume_worker.scenes import delete_scene

LOOK = {"materials": {"Paper": {"terms": [{"model": "lambert", "color": [0.1, 0.2, 0.3]}]}}}
PATHS = {"show": "first_bounce", "bounces": 3}


def body(baked: Baked, **more: Any) -> dict[str, Any]:
    return {"bake": baked.bake, "view": "left", "views": ["front", "left"], "look": LOOK, **more}


def test_link_returns_the_shared_look(client: TestClient, baked: Baked) -> None:
    made = client.post("/api/shares", json=body(baked, solo="Paper", solo_light="", paths=PATHS))
    assert made.status_code == 201
    entry = made.json()
    assert re.fullmatch("[a-z2-7]{10}", entry["id"])
    assert entry["url"] == f"/?share={entry['id']}"
    assert made.headers["location"] == f"/api/shares/{entry['id']}"
    shared = client.get(made.headers["location"]).json()
    assert shared["look"]["materials"]["Paper"]["terms"][0]["color"] == [0.1, 0.2, 0.3]
    assert set(shared["look"]) == set(default_look(tiny_scene().materials))  # complete
    assert (shared["scene"], shared["bake"], shared["view"], shared["views"]) == (
        baked.scene, baked.bake, "left", ["front", "left"],
    )  # fmt: skip
    assert (shared["solo"], shared["solo_light"], shared["paths"], shared["missing"]) == ("Paper", "", PATHS, [])
    assert shared["look"]["transport"]["show"] == "all"
    assert shared["cameras"] == {}
    plain = client.get(client.post("/api/shares", json=body(baked)).headers["location"]).json()
    assert (plain["solo"], plain["solo_light"], plain["paths"]) == (None, None, None)


def test_link_keeps_the_order_of_lights(client: TestClient, baked: Baked) -> None:
    light = {"kind": "point", "position": [0.0, 1.0, 0.0], "emission": [1.0, 1.0, 1.0]}
    for names in (["Key", "Softbox", "Back"], ["Softbox", "Back", "Key"]):
        made = client.post("/api/shares", json=body(baked, look={"lights": dict.fromkeys(names, light)}))
        response = client.get(made.headers["location"])
        assert list(response.json()["look"]["lights"]) == names


def test_link_keeps_cameras(client: TestClient, baked: Baked) -> None:
    cameras = {"left": {"to_world": [1.0, 0, 0, 2, 0, 1, 0, 3, 0, 0, 1, 4, 0, 0, 0, 1], "yfov": 40.0, "near": 0.1}}
    made = client.post("/api/shares", json=body(baked, cameras=cameras, sizes={"left": [90, 60]}))
    shared = client.get(made.headers["location"]).json()
    assert (shared["cameras"], shared["sizes"]) == (cameras, {"left": [90, 60]})
    mirrored = [-1.0, *cameras["left"]["to_world"][1:]]
    for refused in (
        {"cameras": {"left": {"to_world": [], "yfov": 1}}},
        {"cameras": {"left": cameras["left"] | {"yfov": 180.0}}},
        {"cameras": {"left": cameras["left"] | {"to_world": mirrored}}},
        {"cameras": {"nobody": cameras["left"]}},
        {"sizes": {"left": [10**6, 1]}},
        {"sizes": {"left": [16384, 16384]}},
        {"sizes": {"nobody": [90, 60]}},
    ):
        assert client.post("/api/shares", json=body(baked, **refused)).status_code == 422, refused


def test_equal_looks_have_the_same_link(client: TestClient, baked: Baked) -> None:
    first = client.post("/api/shares", json=body(baked))
    again = client.post("/api/shares", json=body(baked))
    assert (first.status_code, again.status_code) == (201, 200)
    assert first.json() == again.json()
    other = client.post("/api/shares", json=body(baked, look={"display": {"exposure": 1.0}}))
    assert other.json()["id"] != first.json()["id"]
    assert client.get(f"/api/shares/{first.json()['id']}").json()["look"]["display"]["exposure"] == 0.0


def test_ids_with_equal_prefixes_grow(client: TestClient, baked: Baked, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(share_store, "ID_LENGTH", 1)
    ids = set()
    for number in range(40):  # more than one character can distinguish
        look = {"display": {"exposure": number / 10}}
        ids.add(client.post("/api/shares", json=body(baked, look=look)).json()["id"])
        assert client.post("/api/shares", json=body(baked, look=look)).json()["id"] in ids
    assert len(ids) == 40
    assert {len(identity) for identity in ids} >= {1, 2}
    for identity in ids:
        assert client.get(f"/api/shares/{identity}").status_code == 200


@pytest.mark.parametrize(
    ("wrong", "status"),
    [
        ({"look": {"materials": {"Nobody": {"terms": []}}}}, 422),
        ({"look": {"display": {"exposure": 1e9}}}, 422),
        ({"view": "nowhere"}, 422),
        ({"views": ["front", "nowhere"]}, 422),
        ({"views": []}, 422),
        ({"views": ["front"] * 5}, 422),
        ({"paths": {"show": "some", "bounces": 3}}, 422),
        ({"paths": {"show": "all", "bounces": 25}}, 422),
        ({"paths": {"show": "all"}}, 422),
        ({"bake": "0" * 16}, 404),
        ({"bake": "../../etc"}, 422),
        ({"more": 1}, 422),
    ],
)
def test_invalid_shares_are_rejected(client: TestClient, baked: Baked, wrong: dict[str, Any], status: int) -> None:
    answer = client.post("/api/shares", json=body(baked, **wrong))
    assert answer.status_code == status
    parse_problem(answer)


def test_links_are_bounded(client: TestClient, baked: Baked, monkeypatch: pytest.MonkeyPatch) -> None:
    latest_id = client.post("/api/shares", json=body(baked)).json()["id"]
    another = body(baked, look={"display": {"exposure": 2.0}})
    for limit, value, status in (("MAX_SHARES", 1, 503), ("MAX_BYTES", 100, 503), ("MAX_SHARE_BYTES", 100, 413)):
        with monkeypatch.context() as context:
            context.setattr(share_store, limit, value)
            answer = client.post("/api/shares", json=another)
            assert answer.status_code == status
            parse_problem(answer)
    monkeypatch.setattr(share_store, "MAX_SHARES", 1)
    assert client.delete(f"/api/shares/{latest_id}").status_code == 204
    assert client.get(f"/api/shares/{latest_id}").status_code == 404
    assert client.post("/api/shares", json=another).status_code == 201


def test_link_lists_missing_assets(client: TestClient, baked: Baked) -> None:
    made = client.post("/api/shares", json=body(baked)).json()["id"]
    bakes = client.app.state.services.bakes
    delete_scene(bakes.data_dir, bakes.ledger, baked.scene)
    (missing,) = client.get(f"/api/shares/{made}").json()["missing"]
    assert "scene" in missing
    for unknown in ("aaaaaaaaaa", "a" * 33, "ABC", "..%2f"):
        assert client.get(f"/api/shares/{unknown}").status_code in (404, 422)
