"""Environments on the command line and over HTTP, and a baked scene lit by one."""

import json
import re
import time

import numpy as np
import OpenImageIO
import pytest
from environment_files import dusk, write_map
from fastapi.testclient import TestClient
from session_client import open_session
from tiny_scenes import still_life

from relume.assets.environments.environment_store import STORE
from relume.assets.environments.read_environment import read_environment
from relume.core.errors import SceneError
from relume.store.bake_protocol import Recipe
from relume_cli.main import main
from relume_server.app import create_app
from relume_server.settings import Settings
from relume_worker.scenes import register_scene
from relume_worker.service import BakeService

URL = "/api/environments"
RECIPE = Recipe("direct", ("front",), (64, 48), 200)


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    data = tmp_path_factory.mktemp("data")
    with TestClient(create_app(Settings(data=data, allowed_hosts=["testserver"]))) as opened:
        yield opened


@pytest.fixture(scope="module")
def imported(client, dusk_file):
    response = client.post(URL, files={"environment": ("some/dusk.exr", dusk_file.read_bytes())})
    assert response.status_code == 201, response.text
    assert response.headers["Location"] == f"{URL}/{response.json()['id']}"
    return response.json()


@pytest.fixture(scope="module")
def bake(client):
    service: BakeService = client.app.state.services.bakes
    scene = register_scene(service.data_dir, service.ledger, still_life())
    identity = service.submit(scene, RECIPE)
    wait(lambda: client.get(f"/api/bakes/{identity}").json()["state"] == "ready")
    return identity


def wait(is_done):
    for _ in range(2_000):  # of a machine that other tests keep busy
        if is_done():
            return
        time.sleep(0.1)
    raise AssertionError("it takes too long")


def test_rest_lists_built_in_environments_first_and_shows_each(client, imported):
    listed = client.get(URL).json()
    assert [entry["map"] for entry in listed] == ["studio", "clear_sky", "sunset", "overcast", imported["map"]]
    assert (imported["name"], imported["map"]) == ("dusk", f"env:{imported['id']}")
    for entry in listed:
        assert client.get(f"{URL}/{entry['id']}").json() == entry
        picture = client.get(entry["thumbnail"])
        assert picture.headers["content-type"] == "image/png"
        assert picture.content.startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\x89PNG\r\n\x1a\n" + b"0" * 100, "neither Radiance .hdr nor OpenEXR"),
        (b"#?RADIANCE\n\n-Y 100000 +X 200000\n", "the limit is 16384×8192"),
        (b"#?RADIANCE\n\n-Y 4096 +X 8192\n", "claims 403 MB"),
        (b"", "empty: 0 bytes"),
    ],
)
def test_hostile_files_are_rejected_with_a_message(tmp_path, content, message):
    path = tmp_path / "x.hdr"
    path.write_bytes(content)
    with pytest.raises(SceneError, match=re.escape(message)):
        read_environment(path, "x")


def test_a_hostile_upload_leaves_no_files(client, imported):
    response = client.post(URL, files={"environment": ("x.hdr", b"#?RADIANCE\n\n-Y 4096 +X 8192\n")})
    assert response.status_code == 422
    assert response.json()["type"] == "urn:relume:problem:scene"
    assert "claims 403 MB" in response.json()["detail"]
    assert len(client.get(URL).json()) == 5
    assert not list(client.app.state.services.settings.data.glob("upload-*"))


def test_names_are_checked(client, dusk_file):
    files = {"environment": ("x.exr", dusk_file.read_bytes())}
    assert client.post(URL, files=files, data={"name": "\x07"}).status_code == 422
    for bad in ("0000000000000000", "..", "nothing"):
        assert client.get(f"{URL}/{bad}").status_code == 404
        assert client.get(f"{URL}/{bad}/thumbnail.png").status_code == 404
    assert client.delete(f"{URL}/studio").status_code == 422


@pytest.mark.slow
def test_a_session_equals_a_render_in_an_imported_environment(client, imported, bake, tmp_path):
    look = {"environment": {"map": imported["map"]}}
    with open_session(client, bake) as session:
        session.exact(0)
        session.edit(1, "/environment/map", imported["map"])
        shown = session.exact(1)
        session.edit(2, "/environment/map", "env:0000000000000000")
        problem = session.text("problem")["problem"]
        assert "'studio'" in problem["detail"]
        session.edit(3, "/environment/map", None)
        session.exact(3)
    assert shown.header["exact"]
    rendered = render(client, bake, look, tmp_path / "dusk.exr")
    own = render(client, bake, {}, tmp_path / "own.exr")
    assert rendered[..., 2].mean() < 0.5 * rendered[..., 0].mean() < 0.5 * own[..., 0].max()
    unknown = {"bake": bake, "view": "front", "looks": [{"environment": {"map": "env:x"}}], "format": "png"}
    assert client.post("/api/renders", json=unknown).json()["parameter"] == "/looks/0/environment/map"


def render(client, bake, look, path):
    request = {"bake": bake, "view": "front", "looks": [look], "format": "exr"}
    url = client.post("/api/renders", json=request).headers["location"]
    wait(lambda: client.get(url).json()["state"] == "ready")
    path.write_bytes(client.get(f"{url}/frames/0").content)
    return OpenImageIO.ImageBuf(str(path)).get_pixels(OpenImageIO.FLOAT)


@pytest.mark.slow
def test_a_comparison_uses_the_environment_of_the_look(client, imported, bake):
    request = {"bake": bake, "view": "front", "look": {"environment": {"map": imported["map"]}}, "passes": 2}
    url = client.post("/api/comparisons", json=request).headers["location"]
    wait(lambda: client.get(url).json()["state"] == "ready")
    assert (
        client.get(url).json()["error_method_paths"]["error_upper_bound"] < 0.25
    )  # in the studio environment it would be above 1


def test_a_deleted_environment_is_unknown(client, bake):
    bright = np.ascontiguousarray(dusk()[::-1])
    path = write_map(client.app.state.services.settings.data / "bright.hdr", bright)
    made = client.post(URL, files={"environment": ("bright.hdr", path.read_bytes())}, data={"name": "Bright"}).json()
    assert made["name"] == "Bright"
    assert client.delete(f"{URL}/{made['id']}").status_code == 204
    assert client.get(f"{URL}/{made['id']}").status_code == 404
    assert made["map"] not in [entry["map"] for entry in client.get(URL).json()]


def test_the_scenes_own_environment_has_a_thumbnail(client, bake):
    picture = client.get(f"/api/bakes/{bake}/environment.png")
    assert picture.headers["content-type"] == "image/png"
    assert picture.content.startswith(b"\x89PNG")


def test_command_line_imports_lists_and_renders(tmp_path, dusk_file, capsys):
    home = ["--data", str(tmp_path)]
    assert main(["environment", "import", str(dusk_file), "--name", "Evening", *home]) == 0
    name = capsys.readouterr().out.strip()
    (record,) = STORE.list_records(tmp_path / "environments")
    assert (record.reference, record.name) == (name, "Evening")
    assert main(["list", "environments", *home]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in listed] == ["studio", "clear_sky", "sunset", "overcast", name]
    for path, message in ((tmp_path / "none.hdr", "file that exists"), (tmp_path / "bad.hdr", "neither Radiance")):
        if "bad" in path.name:
            path.write_bytes(b"bad")
        assert main(["environment", "import", str(path), *home]) == 1
        assert message in capsys.readouterr().err


def test_a_look_from_a_file_names_the_map_on_the_command_line(tmp_path, dusk_file, capsys):
    service = BakeService(tmp_path)
    with service:
        scene = register_scene(service.data_dir, service.ledger, still_life())
        identity = service.submit(scene, RECIPE)
        wait(lambda: service.get(identity).state == "ready")
    home = ["--data", str(tmp_path)]
    assert main(["environment", "import", str(dusk_file), *home]) == 0
    (tmp_path / "look.json").write_text(json.dumps({"environment": {"map": capsys.readouterr().out.strip()}}))
    output = tmp_path / "picture.exr"
    assert main(["render", scene, "--look", str(tmp_path / "look.json"), "--output", str(output), *home]) == 0
    assert "small light sources are approximate" in capsys.readouterr().err
    picture = OpenImageIO.ImageBuf(str(output)).get_pixels(OpenImageIO.FLOAT)
    assert picture[..., 2].mean() < 0.5 * picture[..., 0].mean()
