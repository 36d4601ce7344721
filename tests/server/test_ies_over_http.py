"""IES files over HTTP: uploaded, listed, used by looks, rejected, and deleted when unused."""

from dataclasses import replace

import numpy as np
import pytest
from fastapi.testclient import TestClient
from ies_files import cosine_web, ies_text
from problems import parse_problem
from server_fakes import tiny_scene

from relume.assets.ies.ies_file import IesFile
from relume.assets.ies.ies_store import IES_FILES
from relume.scene.model import Light
from relume_server.app import create_app
from relume_server.settings import Settings
from relume_worker.scenes import register_scene

URL = "/api/ies"
POLAR = np.arange(0, 91, 5)


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    with TestClient(create_app(Settings(data=tmp_path_factory.mktemp("data"), allowed_hosts=["testserver"]))) as opened:
        yield opened


def upload(client, content, name="Lamp.ies"):
    return client.post(URL, files={"ies": (name, content)})


def test_an_uploaded_file_is_listed_with_its_emission_and_planes(client):
    response = upload(client, ies_text(cosine_web(1, POLAR, scale=6830), POLAR))
    assert response.status_code == 201, response.text
    body = response.json()
    assert response.headers["Location"] == f"{URL}/{body['id']}"
    assert (body["name"], body["profile"], body["warnings"]) == ("Lamp", f"ies:{body['id']}", [])
    assert (body["candela"], body["emission"]) == (pytest.approx(6830), pytest.approx(10))
    assert [len(plane) for plane in body["planes"]] == [37] * 4
    assert body["planes"][2][:13] == pytest.approx(np.cos(np.radians(np.arange(0, 61, 5))), abs=1e-3)
    assert client.get(URL).json() == [body] == [client.get(f"{URL}/{body['id']}").json()]


def test_planes_of_a_plot_have_their_azimuths(client):
    azimuth = np.arange(0, 361, 90)
    candela = np.outer([4, 3, 2, 1, 4], np.ones(len(POLAR)))
    body = upload(client, ies_text(candela, POLAR, azimuth), "Four.ies").json()
    assert [plane[3] for plane in body["planes"]] == [1, 0.75, 0.5, 0.25]
    assert client.delete(f"{URL}/{body['id']}").status_code == 204
    assert client.get(f"{URL}/{body['id']}").status_code == 404


def test_a_broken_file_is_rejected_with_the_reason(client):
    response = upload(client, "IESNA:LM-63-2002\nTILT=NONE\n1 1000 1 1000000 1 1 2 0 0 0\n")
    assert response.status_code == 422
    assert "1000000 vertical angles" in response.json()["detail"]


def test_a_file_that_a_light_of_a_scene_uses_stays_until_the_scene_is_deleted(client):
    data = ies_text(cosine_web(1, POLAR, scale=100), POLAR).encode()
    profile = IES_FILES.name_of(data)
    light = Light("Lamp", {"kind": "point", "position": [0.0, 1.0, 0.0], "profile": profile})
    scene = replace(tiny_scene(), name="Gallery", lights=(light,), ies_files=(IesFile("Lamp", data),))
    bakes, url = client.app.state.services.bakes, f"{URL}/{profile.removeprefix('ies:')}"
    identity = register_scene(bakes.data_dir, bakes.ledger, scene)
    problem = parse_problem(client.delete(url))
    assert problem["status"] == 409
    assert "scene 'Gallery'" in problem["detail"]
    assert client.get(url).status_code == 200
    assert client.delete(f"/api/scenes/{identity}").status_code == 204
    assert client.delete(url).status_code == 204
