"""Validation errors have one form: the field as a JSON pointer, the value, and the allowed values."""

import re
from typing import Any

import pytest
from fastapi.testclient import TestClient
from problems import parse_problem
from session_client import Baked

from relume.core.errors import bytes_text

BAKES, RENDERS, SYNTHETIC = "/api/bakes", "/api/renders", "/api/materials/btf/jobs/synthetic"
SCENE = "0123456789abcdef"
OF_PYDANTIC = re.compile(r"Input should|Field required|should have at|literal\[|/body|None|Value error|at least 1 item")
"""What is never said."""


def refused(client: TestClient, url: str, **call: Any) -> dict[str, Any]:
    problem = parse_problem(client.post(url, **call))
    assert problem["status"] == 422
    assert not OF_PYDANTIC.search(str(problem)), problem
    return problem


@pytest.mark.parametrize(
    ("url", "body", "said"),
    [
        (RENDERS, {"format": "tiff"}, "/format is 'tiff'; give 'exr', 'png', 'webp', 'mp4' or 'contact_sheet'"),
        (RENDERS, {"looks": []}, "/looks is a list of 0 looks, with saved_looks; give 1 to 1,000 looks"),
        (RENDERS, {"looks": [1]}, "/looks/0 is 1; give an object"),
        (RENDERS, {"fps": 0}, "/fps is 0; give at least 1"),
        (RENDERS, {"fps": "x"}, "/fps is 'x'; give a whole number"),
        (RENDERS, {"fps": None}, "/fps is null; give a whole number"),
        (RENDERS, {"layers": "all"}, "/layers is 'all'; give 'light_groups', or true or false"),
        (RENDERS, {"path": {"turntable": 0}}, "/path/turntable is 0; give at least 1"),
        (
            RENDERS,
            {"path": {"turntable": 4, "start_camera": {"yfov": 40}}},
            "/path/start_camera/to_world is missing; add it",
        ),
        (RENDERS, {"path": {"cameras": []}}, "/path/cameras is a list of 0 entries; give at least 1 entry"),
        (RENDERS, {"size": "1920x1080"}, "/size is '1920x1080'; give [width, height] in pixels"),
        (RENDERS, {"size": [0, 4]}, "/size/0 is 0; give at least 1"),
        (RENDERS, {"sizes": 3}, "/sizes is unknown; remove it"),
        (RENDERS, {"a/b~c": 3}, "/a~1b~0c is unknown; remove it"),
        (RENDERS, {"bake": "Teapot"}, "/bake is 'Teapot'; give its id, 16 hexadecimal digits"),
        (BAKES, {"scene": "still_life"}, "/scene is 'still_life'; give its id, 16 hexadecimal digits"),
        (BAKES, {"scene": SCENE, "views": [5]}, "/views/0 is 5; give text, or an object"),
        (BAKES, {"scene": SCENE, "views": [{"name": "a", "yfov": 3}]}, "/views/0/to_world is missing; add it"),
        (BAKES, {}, "/scene is missing; add it"),
        (BAKES, [], "the body is not a JSON object; send one with Content-Type: application/json"),
        (SYNTHETIC, {"geometry": "fur"}, "/geometry is 'fur'; give 'weave', 'pebbles' or 'corduroy'"),
    ],
)
def test_invalid_bodies(client: TestClient, url: str, body: Any, said: str) -> None:
    whole = {"bake": SCENE, "view": "front", "format": "png", "looks": [{}], **body} if url == RENDERS else body
    problem = refused(client, url, json=whole)
    assert problem["detail"] == said
    (error,) = problem["errors"]
    assert error["detail"] == said
    assert said.startswith(error["pointer"] or "the body")


def test_unparsable_bodies(client: TestClient) -> None:
    json_type = {"content-type": "application/json"}
    assert refused(client, BAKES, content="scene", headers=json_type)["detail"] == (
        "the body is not JSON (Expecting value, character 0); send JSON"
    )
    assert refused(client, BAKES, data={"scene": SCENE})["detail"].startswith("the body is not a JSON object; send one")
    assert refused(client, BAKES)["detail"] == "the body is missing; send JSON"


def test_invalid_forms(client: TestClient) -> None:
    assert refused(client, "/api/scenes", data={"scene": "a text"})["detail"] == (
        "/scene is text; give a file, with a file name in its part of the form"
    )
    sent = {"geometry": ("a.obj", b"v 0 0 0")}
    problem = refused(client, "/api/materials/btf/jobs/geometry", files=sent, data={"size": "10000", "period": "x"})
    assert problem["detail"] == "/period is 'x'; give a number; /size is '10000'; give at most 256"
    assert [error["pointer"] for error in problem["errors"]] == ["/period", "/size"]


def test_later_rejections_have_the_same_form(client: TestClient, baked: Baked) -> None:
    body = {"bake": baked.bake, "view": "front", "format": "exr", "looks": [{}]}
    problem = refused(client, RENDERS, json={**body, "view": "back"})
    assert problem["detail"] == "view is 'back'; give one of front, left"
    assert problem["errors"] == [{"pointer": "/view", "detail": problem["detail"]}]
    problem = refused(client, RENDERS, json={**body, "color_space": "ACEScg"})
    allowed = "no color space, because there is no OpenColorIO config here (RELUME_OCIO)"
    assert problem["detail"] == f"color_space is 'ACEScg'; give {allowed}"
    problem = refused(client, RENDERS, json={**body, "path": {"turntable": 8}})
    assert problem["detail"].startswith("path is 'turntable 8'; give no path, because this bake has fixed cameras")
    problem = refused(client, RENDERS, json={**body, "looks": [{"display": {"exposure": "x"}}]})
    assert problem["errors"][0]["pointer"] == "/looks/0/display/exposure"
    wrong_key = client.put("/api/looks/a", json={"materialz": {}})
    assert parse_problem(wrong_key)["detail"].startswith("/materialz is {}; give one of the sections of a look: ")


def test_invalid_queries_and_methods(client: TestClient) -> None:
    problem = parse_problem(client.get("/api/bakes?limit=x&state=done"))
    assert problem["errors"][0] == {"parameter": "limit", "detail": "limit is 'x'; give a whole number"}
    assert problem["errors"][1]["parameter"] == "state"
    method = client.patch("/api/renders")
    assert method.status_code == 405
    assert parse_problem(method)["detail"] == "PATCH is not allowed here; use GET or POST"


def test_many_errors_are_counted(client: TestClient) -> None:
    problem = refused(client, BAKES, json={"scene": SCENE, **{f"x{k}": k for k in range(7)}})
    assert problem["detail"].endswith("; and 4 more")
    assert len(problem["errors"]) == 7
    assert len(refused(client, BAKES, json={f"x{k}": k for k in range(100)})["errors"]) == 20


@pytest.mark.parametrize(
    ("num_bytes", "said"),
    [(0, "0 bytes"), (999, "999 bytes"), (34_123, "34 kB"), (999_600, "1 MB"), (1_234_567, "1.2 MB"),
     (371e6, "371 MB"), (80_683e6, "81 GB"), (4_108_145e6, "4.1 TB"), (9e15, "9000 TB")],
)  # fmt: skip
def test_byte_sizes_have_a_suitable_unit(num_bytes: float, said: str) -> None:
    assert bytes_text(num_bytes) == said
