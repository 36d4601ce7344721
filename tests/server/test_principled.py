"""/api/models/principled: parameters of a scene's material, and terms of parameters."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from glb_builder import Glb

PATH = "/api/models/principled"
LAMBERT = {"model": "lambert", "color": [0.4, 0.2, 0.1], "texture": None}


def test_parameters_and_terms_of_a_material(client: TestClient) -> None:
    given = {"base_color": [0.6, 0.3, 0.1], "metallic": 0.4, "roughness": 0.3}
    made = client.post(f"{PATH}/terms", json={"parameters": given, "terms": [LAMBERT]}).json()
    assert [term["model"] for term in made["terms"]] == ["lambert", "ggx"]
    assert made["glass"] is None
    read = client.post(PATH, json={"terms": made["terms"]}).json()
    assert (read["reason"], read["terms"]) == (None, made["terms"])
    assert {name: read["parameters"][name] for name in given} == {
        name: pytest.approx(value, abs=1e-4) for name, value in given.items()
    }
    assert read["parameters"]["transmission"] == 0
    glass = {"color": [1, 1, 1], "roughness": 0.3, "ior": 1.5}
    body = {"parameters": {**given, "metallic": 0, "transmission": 0.5}, "terms": [LAMBERT], "glass": glass}
    assert client.post(f"{PATH}/terms", json=body).json()["glass"]["color"] == pytest.approx([0.3, 0.15, 0.05])


def test_parameters_are_those_at_the_mean_of_a_scenes_textures(client: TestClient) -> None:
    glb = Glb()
    texture = glb.texture(np.array([[[255, 255, 255], [0, 0, 0]]], np.uint8))
    pbr = {"baseColorTexture": {"index": texture}, "metallicFactor": 0}
    glb.quad({"name": "Checks", "pbrMetallicRoughness": pbr})
    created = client.post("/api/scenes", files={"scene": ("checks.glb", glb.bytes())}).json()
    scene = client.get(f"/api/scenes/{created['id']}").json()
    terms = scene["materials"][0]["terms"]
    read = client.post(PATH, json={"terms": terms, "scene": created["id"], "material": "Checks"}).json()
    assert read["reason"] is None
    assert read["texture_means"] == {"diffuse": [0.5] * 3, "specular": [1.0] * 3}
    assert read["parameters"]["base_color"] == pytest.approx([0.5] * 3, abs=1e-4)
    red = {**read["parameters"], "base_color": [0.5, 0.25, 0.0]}
    body = {"parameters": red, "terms": terms, "texture_means": read["texture_means"]}
    made = client.post(f"{PATH}/terms", json=body).json()
    white = np.array(terms[0]["color"])
    assert made["terms"][0]["color"] == pytest.approx(white * [1, 0.5, 0], abs=1e-4)
    assert made["terms"][0]["texture"] == "diffuse"
    for unknown in ({"scene": "0" * 16, "material": "Checks"}, {"scene": created["id"], "material": "Nope"}):
        assert client.post(PATH, json={"terms": terms, **unknown}).status_code == 404


@pytest.mark.parametrize(
    ("path", "change"),
    [
        ("/terms", {"parameters": {"metallic": 2}}),
        ("/terms", {"parameters": {"metal": 1}}),
        ("/terms", {"parameters": {}, "glass": {"ior": 0}}),
        ("", {"glass": {"color": [1, 1]}}),
        ("", {"terms": []}),
    ],
)
def test_invalid_requests_name_the_value(client: TestClient, path: str, change: dict[str, Any]) -> None:
    answer = client.post(PATH + path, json={"terms": [LAMBERT], **change})
    assert answer.status_code == 422
    assert len(answer.json()["detail"]) > 10
