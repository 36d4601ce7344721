"""Identity and deletion of resources, as docs/api.md describes them."""

from typing import Any

from fastapi.testclient import TestClient
from problems import parse_problem
from session_client import Baked

OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def imported(client: TestClient, name: str, content: bytes = OBJ) -> Any:
    answer = client.post("/api/scenes", files={"scene": ("a.obj", content)}, data={"name": name})
    assert answer.status_code == 201, answer.text
    return answer.json()


def test_scene_identity_is_file_and_name(client: TestClient) -> None:
    first, again, other = imported(client, "A"), imported(client, "A"), imported(client, "B")
    assert first["id"] == again["id"] != other["id"]
    assert imported(client, "A", OBJ + b"v 2 2 2\nf 1 2 4\n")["id"] not in (first["id"], other["id"])
    assert [scene["name"] for scene in client.get("/api/scenes").json()].count("A") == 2
    assert client.get("/api/scenes?name=B").json() == [other]


def test_equal_recipes_are_the_same_bake(client: TestClient, baked: Baked) -> None:
    recipe = {"scene": baked.scene, "method": "direct", "views": ["front"], "size": [160, 96], "lights": 10}
    first, again = (client.post("/api/bakes", json=recipe).json()["id"] for _ in range(2))
    assert first == again
    assert client.post("/api/bakes", json={**recipe, "lights": 11}).json()["id"] != first


def test_finished_bake_is_deleted_only_if_requested(client: TestClient, baked: Baked) -> None:
    url = f"/api/bakes/{baked.bake}"
    refused = client.delete(url)
    assert refused.status_code == 409
    assert parse_problem(refused)["detail"].endswith("; ?delete_files=true deletes it")
    assert client.get(url).json()["state"] == "ready"
    assert client.delete(f"{url}?delete_files=true").status_code == 204
    assert client.get(url).status_code == 404
