"""POST /api/solve: lights from strokes and reference pictures."""

import base64
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from problems import parse_problem
from session_client import Baked

from relume.image_io.write_image import png_bytes
from relume_server.request_limits import MAX_JSON_BYTES

KEY_LIGHT = {"kind": "point", "intensity": 1.0}
LEFT, RIGHT = [[40.0, 48.0]], [[120.0, 48.0]]


def solve(client: TestClient, baked: Baked, **fields: Any) -> dict[str, Any]:
    """The answer for a look with a point light, which lights the left half of the image."""
    response = client.post("/api/solve", json=body(baked, **fields))
    assert response.status_code == 200, response.text
    answer: dict[str, Any] = response.json()
    return answer


def body(baked: Baked, **fields: Any) -> dict[str, Any]:
    return {"bake": baked.bake, "view": "front", "look": {"lights": {"Key": KEY_LIGHT}}, **fields}


def encoded(data: bytes) -> str:
    return base64.b64encode(data).decode()


def test_a_stroke_changes_the_light_that_it_marks(client: TestClient, baked: Baked) -> None:
    stroke = {"kind": "brighter", "points": LEFT, "radius": 10}
    answer = solve(client, baked, strokes=[stroke], locked=["/environment"])
    assert [change["pointer"] for change in answer["changes"]] == ["/lights/Key"]
    assert answer["look"]["lights"]["Key"]["intensity"] == pytest.approx(3.0, rel=0.2)  # 1 + 1 becomes 1 + 3
    assert answer["look"]["lights"]["Key"]["kind"] == "point"
    assert answer["patch"][0]["path"] == "/lights/Key/intensity"


def test_a_reference_picture_is_matched(client: TestClient, baked: Baked) -> None:
    picture = png_bytes(np.full((48, 80, 3), 100, np.uint8))
    look = {"lights": {"Key": KEY_LIGHT}, "display": {"tone_map": "none"}}
    answer = solve(client, baked, look=look, reference={"image": encoded(picture)})
    assert answer["look"]["lights"]["Key"]["intensity"] == pytest.approx(0.0, abs=1e-3)
    assert answer["look"]["environment"]["intensity"] == pytest.approx(0.1274, rel=0.02)
    assert answer["residual"] < 0.02 < answer["residual_before"]


def test_a_mask_marks_pixels(client: TestClient, baked: Baked) -> None:
    mask = np.zeros((96, 160), np.uint8)
    mask[:, 90:] = 255
    stroke = {"kind": "color", "mask": encoded(png_bytes(mask)), "color": [1.0, 0.2, 0.2]}
    answer = solve(client, baked, strokes=[stroke], locked=["/lights/Key"])
    red, green, blue = answer["look"]["environment"]["color"]
    assert green / red == pytest.approx(0.2, abs=0.1)
    assert green == pytest.approx(blue)


def test_strokes_without_color_change_intensities_alone(client: TestClient, baked: Baked) -> None:
    stroke = {"kind": "darker", "points": RIGHT}
    assert all(not op["path"].endswith("color") for op in solve(client, baked, strokes=[stroke])["patch"])
    colored = solve(client, baked, strokes=[stroke], change="color")
    assert any(op["path"].endswith("color") for op in colored["patch"])


def test_unreached_strokes_are_named(client: TestClient, baked: Baked) -> None:
    strokes = [{"kind": "brighter", "points": points, "stops": 2.0} for points in (RIGHT, LEFT)]
    answer = solve(client, baked, strokes=strokes, locked=["/environment"])
    (shortfall,) = answer["shortfalls"]
    assert (shortfall["stroke"], shortfall["cause"]) == (0, "locked")
    assert shortfall["asked_stops"] == pytest.approx(2.0, abs=0.01)
    assert shortfall["reached_stops"] == pytest.approx(0.0, abs=0.01)


def test_without_a_target_nothing_changes(client: TestClient, baked: Baked) -> None:
    answer = solve(client, baked)
    assert (answer["patch"], answer["changes"], answer["shortfalls"]) == ([], [], [])
    assert answer["look"] == {"lights": {"Key": KEY_LIGHT}}


def test_a_reference_picture_may_be_larger_than_other_documents(client: TestClient, baked: Baked) -> None:
    noise = np.random.default_rng(1).integers(0, 255, (600, 700, 3), np.uint8)
    picture = png_bytes(noise)
    assert len(picture) > MAX_JSON_BYTES
    assert solve(client, baked, reference={"image": encoded(picture)})["residual"] > 0


def test_materials_follow_by_request(client: TestClient, baked: Baked) -> None:
    """Only the material can change, so its terms are replaced in the patch and in the partial look."""
    picture = png_bytes(np.full((48, 80, 3), 100, np.uint8))
    look = {"display": {"tone_map": "none"}}
    fields = {"look": look, "reference": {"image": encoded(picture)}, "locked": ["/environment"]}
    answer = solve(client, baked, **fields, materials=["Paper"])
    (operation,) = answer["patch"]
    assert (operation["path"], answer["materials"]) == ("/materials/Paper/terms", ["Paper"])
    assert answer["look"]["materials"]["Paper"]["terms"] == operation["value"]
    assert answer["residual"] < 0.5 * answer["residual_before"]
    assert solve(client, baked, **fields)["materials"] == []


@pytest.mark.parametrize(
    "fields",
    [
        {"view": "behind"},
        {"look": {"lights": {"Key": {"kind": "torch"}}}},
        {"locked": ["/lights/Zenith"]},
        {"camera": {"to_world": np.eye(4).ravel().tolist(), "yfov": 40.0}},
        {"size": [10, 10]},
        {"strokes": [{"kind": "louder", "points": LEFT}]},
        {"strokes": [{"kind": "brighter", "points": LEFT, "radius": 0}]},
        {"strokes": [{"kind": "brighter", "points": [[0, 1e9]]}]},
        {"strokes": [{"kind": "brighter", "points": LEFT, "stops": -1}]},
        {"strokes": [{"kind": "brighter", "mask": "no base64!"}]},
        {"strokes": [{"kind": "brighter", "mask": encoded(b"no picture")}]},
        {"strokes": [{"kind": "reference", "points": LEFT}]},
        {"strokes": [{"kind": "brighter", "points": LEFT}] * 65},
        {"strokes": [{"kind": "brighter", "points": LEFT * 2049}]},
        {"reference": {"image": encoded(b"no picture")}},
        {"materials": ["Paper"] * 33},
        {"strokes": [{"kind": "brighter", "points": LEFT}], "materials": ["Ghost"]},
    ],
)
def test_invalid_requests_are_refused(client: TestClient, baked: Baked, fields: dict[str, Any]) -> None:
    assert parse_problem(client.post("/api/solve", json=body(baked, **fields)))["status"] == 422


def test_an_unknown_bake_is_not_found(client: TestClient, baked: Baked) -> None:
    assert parse_problem(client.post("/api/solve", json={**body(baked), "bake": "0" * 16}))["status"] == 404
