"""Measured materials on the command line and over HTTP."""

import io
import json

import numpy as np
import pytest
from fastapi.testclient import TestClient
from merl_files import make_planes
from PIL import Image

from relume.assets.measured.measured_store import records
from relume.assets.measured.merl import is_measured, read_merl, write_merl
from relume_cli.main import main
from relume_server.app import create_app
from relume_server.settings import Settings

RED = ({"model": "lambert", "color": [0.8, 0.1, 0.1]},)


@pytest.fixture(scope="module")
def red(tmp_path_factory):
    path = tmp_path_factory.mktemp("red") / "red.binary"
    write_merl(path, make_planes(RED))
    return path


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A data folder for all tests here: a material that one test imports is available to the next."""
    return tmp_path_factory.mktemp("home")


def test_command_line_imports_a_file_and_exports_the_edited_one(home, red, tmp_path, capsys):
    assert main(["material", "import", str(red), "--name", "Red paint", "--data", str(home)]) == 0
    printed = capsys.readouterr()
    (record,) = records(home / "materials")
    assert (printed.out, record.name) == (f"{record.data}\n", "Red paint")
    terms = json.loads(printed.err.splitlines()[0])["terms"]
    terms[0]["color"] = [0.5, 2.0, 1.0]
    look, output = tmp_path / "look.json", tmp_path / "edited.binary"
    look.write_text(json.dumps({"materials": {"Wall": {"terms": terms}}}))
    assert main(["material", "export", str(look), "Wall", "--output", str(output), "--data", str(home)]) == 0
    before, after = read_merl(red), read_merl(output)
    was_measured = is_measured(before)
    for channel, scale in enumerate((0.5, 2.0, 1.0)):
        np.testing.assert_allclose(after[channel, was_measured], scale * before[channel, was_measured], rtol=1e-6)


def test_command_line_reports_errors_in_one_line(home, tmp_path, capsys):
    (tmp_path / "bad.binary").write_bytes(b"bad")
    (tmp_path / "look.json").write_text(json.dumps({"materials": {"Wall": {"terms": [{"model": "measured_lv"}]}}}))
    look, data = str(tmp_path / "look.json"), ["--data", str(home)]
    for arguments, said in (
        (["import", str(tmp_path / "bad.binary")], "not a MERL file"),
        (["import", str(tmp_path / "bad.binary"), "--name", " "], "printable"),
        (["export", look, "Floor", "--output", str(tmp_path / "x.binary")], "terms are in the look"),
        (["export", look, "Wall", "--output", str(tmp_path / "x.binary")], "imported here"),
        (["export", look, "Wall", "--output", str(tmp_path / "no" / "x.binary")], "folder that exists"),
    ):
        assert main(["material", *arguments, *data]) == 1
        assert said in capsys.readouterr().err
    assert not (tmp_path / "x.binary").exists()


def test_rest_imports_lists_shows_and_deletes(home, red, tmp_path):
    settings = Settings(data=tmp_path / "data", client=tmp_path / "client", allowed_hosts=["testserver"])
    with TestClient(create_app(settings)) as client:
        url = "/api/materials/measured"
        rejected = client.post(url, files={"material": ("some/cayman.brdf", b"no measurement")})
        assert rejected.json()["detail"].startswith("cayman.brdf is not a MERL file")
        response = client.post(url, files={"material": ("some/red.binary", red.read_bytes())})
        assert response.status_code == 201, response.text
        made = response.json()
        assert response.headers["Location"] == f"{url}/{made['id']}"
        assert (made["name"], made["data"]) == ("red", f"merl:{made['id']}")
        assert [term["model"] for term in made["terms"]] == ["measured_lv", "measured_hd"]
        assert max(made["lobes_error"]) < 0.01
        assert client.get(url).json() == [made] == [client.get(f"{url}/{made['id']}").json()]
        ball = np.asarray(Image.open(io.BytesIO(client.get(made["thumbnail"]).content)), int)
        assert ball.shape == (64, 64, 3)
        assert ball[16:48, 16:48, 0].mean() > 1.5 * ball[16:48, 16:48, 2].mean()
        needing = [m["model"] for m in client.get("/api/models").json() if m["needs_data"]]
        assert needing == ["measured_lv", "measured_hd", "measured_hf", "measured_btf"]
        look = {"materials": {"Ball": {"terms": made["terms"]}}}
        assert client.put("/api/looks/red", json=look).status_code == 201
        assert "look 'red'" in client.delete(f"{url}/{made['id']}").json()["detail"]
        assert client.delete("/api/looks/red", headers={"If-Match": "*"}).status_code == 204
        assert client.delete(f"{url}/{made['id']}").status_code == 204
        assert client.get(url).json() == []
        assert client.get(f"{url}/{made['id']}").status_code == 404
