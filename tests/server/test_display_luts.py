"""Display LUTs over HTTP: uploaded, listed, in renders as in previews, rejected, and deleted when unused."""

import io
from collections.abc import Callable

import numpy as np
import pytest
from fastapi.testclient import TestClient
from PIL import Image
from session_client import Baked
from test_comparisons import is_done, wait_until

from relume.image_io.white_balance import balance_matrix

# the corners of a cube, red fastest: red inverted, green as it is, half the blue
GRADE = "LUT_3D_SIZE 2\n" + "".join(f"{1 - r} {g} {b / 2}\n" for b in (0, 1) for g in (0, 1) for r in (0, 1))
Render = Callable[[dict[str, object]], np.ndarray]


def upload(client: TestClient, content: str, name: str = "grade.cube") -> dict[str, object]:
    response = client.post("/api/luts", files={"lut": (name, content.encode())})
    assert response.status_code == 201, response.text
    body: dict[str, object] = response.json()
    assert response.headers["Location"] == f"/api/luts/{body['id']}"
    return body


@pytest.fixture
def render(client: TestClient, baked: Baked) -> Render:
    def rendered(display: dict[str, object]) -> np.ndarray:
        look = {"display": {"tone_map": "none", "exposure": -1.0} | display}
        request = {"bake": baked.bake, "view": "front", "looks": [look], "format": "png"}
        url = client.post("/api/renders", json=request).headers["location"]
        assert wait_until(client, url, is_done)["state"] == "ready"
        with Image.open(io.BytesIO(client.get(f"{url}/frames/0").content)) as picture:
            return np.asarray(picture)[..., :3].astype(np.float64)

    return rendered


def test_a_lut_is_listed_and_its_table_has_its_own_size(client: TestClient) -> None:
    body = upload(client, GRADE)
    assert (body["name"], body["size"], body["lut"], body["warnings"]) == ("grade", 2, f"lut:{body['id']}", [])
    assert client.get("/api/luts").json() == [body] == [client.get(f"/api/luts/{body['id']}").json()]
    answer = client.get(f"/api/luts/{body['id']}/table")
    assert answer.status_code == 200, answer.text
    table = np.frombuffer(answer.content, "<u2").reshape(2, 2, 2, 3)
    np.testing.assert_array_equal(table[0, 1, 1], [65535, 65535, 32768])
    np.testing.assert_array_equal(table[1, 0, 0], [0, 0, 0])


def test_renders_have_the_white_balance_and_the_lut(client: TestClient, render: Render) -> None:
    plain, lut = render({}) / 255, upload(client, GRADE)["lut"]
    assert 0.3 < plain.min() <= plain.max() < 0.8
    graded = np.stack([1 - plain[..., 0], plain[..., 1], plain[..., 2] / 2], axis=-1)
    np.testing.assert_allclose(render({"lut": lut}) / 255, graded, atol=1.01 / 255)
    expected = np.clip(decoded(plain) @ balance_matrix(5200.0, 10.0).T, 0, 1)
    assert np.ptp(expected, axis=-1).min() > 0.1
    balanced = render({"temperature": 5200.0, "tint": 10.0}) / 255
    np.testing.assert_allclose(decoded(balanced), expected, atol=0.01)  # two roundings to 8 bits
    steeper = np.clip(decoded(plain) ** 2 / 0.18, 0, 1)
    np.testing.assert_allclose(decoded(render({"contrast": 2.0}) / 255), steeper, atol=0.02)


def decoded(display: np.ndarray) -> np.ndarray:
    return np.where(display <= 0.04045, display / 12.92, ((display + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize(
    ("display", "pointer"),
    [
        ({"lut": "lut:0123456789abcdef"}, "/display/lut"),
        ({"lut": 3}, "/display/lut"),
        ({"lut": "../x"}, "/display/lut"),
        ({"temperature": 100.0}, "/display/temperature"),
        ({"temperature": "warm"}, "/display/temperature"),
        ({"tint": 1000.0}, "/display/tint"),
        ({"contrast": 0.0}, "/display/contrast"),
    ],
)
def test_invalid_settings_are_rejected_where_they_are(
    client: TestClient, baked: Baked, display: dict[str, object], pointer: str
) -> None:
    response = client.post(
        "/api/renders", json={"bake": baked.bake, "view": "front", "looks": [{"display": display}], "format": "png"}
    )
    assert response.status_code == 422
    assert pointer in response.text


def test_unusable_files_are_rejected_and_used_luts_are_not_deleted(client: TestClient) -> None:
    response = client.post("/api/luts", files={"lut": ("a.cube", b"LUT_3D_SIZE 256\n0 0 0\n")})
    assert (response.status_code, response.json()["detail"].count("from 2 to 65")) == (422, 1)
    body = upload(client, GRADE)
    saved = {"display": {"lut": body["lut"]}}
    assert client.put("/api/looks/graded", json=saved, headers={"If-None-Match": "*"}).status_code == 201
    refused = client.delete(f"/api/luts/{body['id']}")
    assert (refused.status_code, "graded" in refused.text) == (409, True)
    client.delete("/api/looks/graded", headers={"If-Match": "*"})
    assert client.delete(f"/api/luts/{body['id']}").status_code == 204
    assert client.get("/api/luts").json() == []
