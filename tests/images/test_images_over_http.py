"""Images over HTTP: uploaded, listed, shown in sessions with undo, rejected, and deleted when unused."""

import io
import time
from functools import partial

import numpy as np
import OpenImageIO
import pytest
from fastapi.testclient import TestClient
from PIL import Image
from session_client import open_session
from tiny_scenes import still_life

from relume.brdf.texture_slots import IMAGES
from relume.core.errors import SceneError
from relume.core.folder_size import folder_bytes
from relume.images.image_store import load_texture, records, store
from relume.images.read_image import MAX_SIDE
from relume.store.bake_protocol import Recipe
from relume_server.app import create_app
from relume_server.client_state.look_state import LookState
from relume_server.client_state.visible_views import VisibleViews
from relume_server.settings import Settings
from relume_worker.paths import images_path
from relume_worker.scenes import register_scene

URL = "/api/images"


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    data = tmp_path_factory.mktemp("data")
    with TestClient(create_app(Settings(data=data, allowed_hosts=["testserver"]))) as opened:
        yield opened


def upload(client, content, name="stripes.png"):
    return client.post(URL, files={"image": (name, content)})


@pytest.fixture(scope="module")
def uploaded(client, image_file):
    response = upload(client, image_file.read_bytes())
    assert response.status_code == 201, response.text
    assert response.headers["Location"] == f"{URL}/{response.json()['id']}"
    return response.json()


def test_an_uploaded_image_is_listed_and_shown(client, uploaded):
    assert (uploaded["name"], uploaded["size"], uploaded["warnings"]) == ("stripes", [32, 32], [])
    assert client.get(URL).json() == [uploaded] == [client.get(f"{URL}/{uploaded['id']}").json()]
    with Image.open(io.BytesIO(client.get(uploaded["thumbnail"]).content)) as picture:
        assert picture.size == (96, 96)


def png(width, height):
    buffer = io.BytesIO()
    Image.new("RGB", (width, height)).save(buffer, "PNG")
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "save it as PNG"),
        (b"\x89PNG\r\n\x1a\n" + 40 * b"x", "save it as PNG"),
        (b"\x76\x2f\x31\x01" + 40 * b"x", "damaged"),
        (b"GIF89a" + 40 * b"\0", "is damaged .*; export it again"),
        (png(2 * MAX_SIDE + 1, 1), f"at most {2 * MAX_SIDE}×{2 * MAX_SIDE}"),
    ],
)
def test_invalid_and_oversized_images_leave_no_files(content, message, tmp_path):
    (tmp_path / "x.png").write_bytes(content)
    with pytest.raises(SceneError, match=message):
        store(tmp_path / "library", tmp_path / "x.png", "x")
    assert not (tmp_path / "library").exists()


def test_a_large_image_is_downsampled_with_a_warning(tmp_path):
    texels = np.zeros((4, MAX_SIDE + 2, 3), np.uint8)
    texels[:, 1::2] = 100
    Image.fromarray(texels).save(tmp_path / "wide.png")
    with IMAGES.with_search_folder(tmp_path / "library") as library:
        record = store(library, tmp_path / "wide.png", "wide")
        pixels = load_texture(record.texture).pixels
    assert record.size == (MAX_SIDE // 2 + 1, 2) == pixels.shape[1::-1]
    assert (pixels == 50).all()
    assert "4098×4" in record.warnings[0]


def test_uploading_the_same_image_again_takes_the_new_name(image_file, tmp_path):
    first, again = (store(tmp_path / "library", image_file, name) for name in ("One", "Two"))
    assert (again.id, again.name, len(records(tmp_path / "library"))) == (first.id, "Two", 1)


def test_an_exr_keeps_its_reflectances_and_reports_clamping(tmp_path):
    pixels = np.array([[[0.001, 0.5, 2.0], [0.25, -1.0, np.nan]]], np.float32)
    path = str(tmp_path / "map.exr")
    out = OpenImageIO.ImageOutput.create(path)
    assert out.open(path, OpenImageIO.ImageSpec(2, 1, 3, OpenImageIO.FLOAT))
    assert out.write_image(pixels)
    assert out.close()
    with IMAGES.with_search_folder(tmp_path / "library") as library:
        record = store(library, tmp_path / "map.exr", "map")
        stored = load_texture(record.texture).pixels.astype(np.float32)
        IMAGES.remove(library, record.id)
        assert not IMAGES.exists(record.texture)
    assert len(record.warnings) == 2
    np.testing.assert_allclose(stored, [[[0.001, 0.5, 1.0], [0, 0, 0]]], rtol=1e-3)


def test_an_image_of_a_saved_look_or_share_link_is_not_deleted(client, uploaded):
    look = {"materials": {"Ball": {"terms": [{"model": "lambert", "texture": uploaded["texture"]}]}}}
    assert client.put("/api/looks/painted", json=look).status_code == 201
    response = client.delete(f"{URL}/{uploaded['id']}")
    assert response.status_code == 409
    assert "look 'painted'" in response.json()["detail"]
    assert client.delete("/api/looks/painted", headers={"If-Match": "*"}).status_code == 204
    assert client.get(f"{URL}/{uploaded['id']}").status_code == 200


def test_an_image_that_a_look_emits_is_not_deleted(client, uploaded):
    look = {"lights": {"Ball": {"kind": "mesh", "material": "Ball", "image": uploaded["texture"]}}}
    assert client.put("/api/looks/glowing", json=look).status_code == 201
    response = client.delete(f"{URL}/{uploaded['id']}")
    assert response.status_code == 409
    assert "look 'glowing'" in response.json()["detail"]
    assert client.delete("/api/looks/glowing", headers={"If-Match": "*"}).status_code == 204


def test_an_image_of_a_session_is_not_deleted_before_the_session(client, uploaded):
    resumes = client.app.state.services.live.resumes
    default = {"materials": {"Ball": {"terms": []}}}
    shows = {"materials": {"Ball": {"terms": [{"model": "lambert", "texture": uploaded["texture"]}]}}}
    token = resumes.open("0123456789abcdef", LookState(default, shows, 0), VisibleViews(["front"], "front"))
    url = f"{URL}/{uploaded['id']}"
    open_now = client.delete(url)
    resumes.close(token, time.monotonic())
    lost = client.delete(url)
    assert (open_now.status_code, lost.status_code) == (409, 409)
    assert "a session of bake 0123456789abcdef" in open_now.json()["detail"]
    assert resumes.take(token, "0123456789abcdef", time.monotonic()) is not None
    assert resumes.looks(time.monotonic()) == []


def test_images_derived_from_a_metallic_map_are_deleted_with_it(client):
    image = upload(client, png(3, 2), "metal.png").json()
    url, terms = f"{URL}/{image['id']}", [{"model": "lambert", "texture": None}, {"model": "ggx", "texture": None}]
    requested = {"scene": 16 * "0", "material": "Ball", "terms": terms}
    made = client.post(f"{url}/metalness", json=requested)
    assert made.status_code == 201, made.text
    textures = [term["texture"] for term in made.json()["terms"]]
    listed = {entry["texture"]: (entry["metalness"], entry["base"]) for entry in client.get(URL).json()}
    assert [listed[texture] for texture in textures] == 2 * [(image["texture"], None)]
    for changed, message in (
        ({"terms": terms[:1]}, "add the missing one"),
        ({"terms": [{**terms[0], "texture": "diffuse"}, terms[1]]}, "import the scene again"),
    ):
        response = client.post(f"{url}/metalness", json={**requested, **changed})
        assert 400 <= response.status_code < 500
        assert message in response.json()["detail"]
    look = {"materials": {"Ball": {"terms": made.json()["terms"]}}}
    assert client.put("/api/looks/metal", json=look).status_code == 201
    assert client.delete(url).status_code == 409
    assert client.delete("/api/looks/metal", headers={"If-Match": "*"}).status_code == 204
    assert client.delete(url).status_code == 204
    assert not {*textures, image["texture"]} & {entry["texture"] for entry in client.get(URL).json()}


def test_images_derived_from_a_metallic_map_are_within_the_quota(client):
    services = client.app.state.services
    image = upload(client, png(64, 32), "metal.png").json()
    terms = [{"model": "lambert", "texture": None}, {"model": "ggx", "texture": None}]
    send = partial(
        client.post, f"{URL}/{image['id']}/metalness", json={"scene": 16 * "0", "material": "Ball", "terms": terms}
    )
    before, num_before = services.access.quotas.used_bytes(""), len(client.get(URL).json())
    services.settings.max_bytes_per_user = before + 2 * 3 * 64 * 32
    refused = send()
    assert (refused.status_code, len(client.get(URL).json())) == (429, num_before)
    services.settings.max_bytes_per_user = None
    textures = {term["texture"].removeprefix(IMAGES.prefix) for term in send().json()["terms"]}
    stored = sum(folder_bytes(images_path(services.settings.data) / texture) for texture in textures)
    assert services.access.quotas.used_bytes("") == before + stored
    assert client.delete(f"{URL}/{image['id']}").status_code == 204


def wait(is_done):
    for _ in range(600):
        if is_done():
            return
        time.sleep(0.1)
    raise AssertionError("it takes too long")


@pytest.mark.slow
def test_a_material_preview_shows_its_images(client, uploaded):
    """The scene's own image and an uploaded one; an unknown image is rejected by its name."""
    scene = client.post("/api/example-scenes/still_life").json()["id"]
    url = f"/api/scenes/{scene}/ball"

    def ball(**given):
        response = client.post(url, json={"material": "Tray", "terms": [{"model": "lambert", **given}]})
        assert response.status_code == 200, response.text
        with Image.open(io.BytesIO(response.content)) as picture:
            assert picture.size == (64, 64)
            return np.asarray(picture.convert("RGB"), int)[8:56, 24:40]

    plain, wood, striped = ball(texture=None), ball(texture="diffuse"), ball(texture=uploaded["texture"])
    assert np.ptp(plain, axis=2).max() < 30
    assert (wood[..., 0] - wood[..., 2]).mean() > 40  # brown
    assert np.abs(striped - wood).max() > 40
    for scene_id, material, texture in (
        (scene, "Lid", "diffuse"),
        (scene, "Tray", "image:0"),
        ("0" * 16, "Tray", None),
    ):
        requested = {"material": material, "terms": [{"model": "lambert", "texture": texture}]}
        assert client.post(f"/api/scenes/{scene_id}/ball", json=requested).status_code in (404, 422)


@pytest.mark.slow
def test_a_session_equals_a_render_and_undo_restores_it(client, uploaded):
    services = client.app.state.services
    scene = register_scene(services.bakes.data_dir, services.bakes.ledger, still_life())
    bake = services.bakes.submit(scene, Recipe("direct", ("front",), (64, 48), 60))
    wait(lambda: client.get(f"/api/bakes/{bake}").json()["state"] == "ready")
    with open_session(client, bake) as session:
        path = "/materials/Floor/terms/0/texture"
        pictures = [session.exact(0)]
        for revision, texture in enumerate((uploaded["texture"], "image:0000000000000000", "diffuse"), 1):
            session.edit(revision, path, texture)
            if revision == 2:
                assert "image that was uploaded" in session.text("problem")["problem"]["detail"]
            else:
                pictures.append(session.exact(revision))
    before, painted, after = (picture.payload for picture in pictures)
    assert before != painted
    assert len(after) == len(painted)
    look = {"materials": {"Floor": {"terms": [{"model": "lambert", "texture": uploaded["texture"]}]}}}
    request = {"bake": bake, "view": "front", "looks": [look, {}], "format": "png"}
    url = client.post("/api/renders", json=request).headers["location"]
    wait(lambda: client.get(url).json()["state"] == "ready")
    frames = [client.get(f"{url}/frames/{k}").content for k in range(2)]
    assert frames[0] != frames[1]
