"""A server with an OpenColorIO config: its display views and renders with them."""

import io
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import OpenImageIO
import pytest
from fastapi.testclient import TestClient
from PIL import Image
from session_client import Baked
from test_comparisons import is_done, wait_until

from relume.image_io.ocio.active_config import config_source, using_config
from relume.image_io.ocio.config import Config
from relume.image_io.ocio.lut import SIZE
from relume.image_io.ocio.view import OcioView
from relume.image_io.primaries import INTEROP_SPACES
from relume.image_io.write_image import to_bytes
from relume_server.batch.cluster_steps import ClusterSteps
from relume_server.services import open_steps
from relume_server.settings import Settings
from relume_worker.executor import Executors

CONFIG = "ocio://cg-config-latest"
VIEW = {"display": "sRGB - Display", "view": "ACES 2.0 - SDR 100 nits (Rec.709)"}


@pytest.fixture
def settings(settings: Settings) -> Settings:
    return settings.model_copy(update={"ocio": CONFIG})


def test_views_are_listed_exported_as_lut_and_rendered(client: TestClient, baked: Baked, tmp_path: Path) -> None:
    color_settings, config = client.get("/api/color").json(), Config(CONFIG)
    assert {each["name"]: tuple(each["views"]) for each in color_settings["displays"]} == config.displays
    assert (color_settings["default"], color_settings["working"], tuple(color_settings["spaces"])) == (
        VIEW,
        config.working,
        config.spaces,
    )
    table = client.get(f"/api/color/{color_settings['id']}/lut", params=VIEW)
    assert table.content == config.table(OcioView(**VIEW)).tobytes()
    assert len(table.content) == 2 * 3 * SIZE**3
    assert "immutable" in table.headers["cache-control"]
    assert client.get(f"/api/color/{'0' * 16}/lut", params=VIEW).status_code == 404
    assert client.get(f"/api/color/{color_settings['id']}/lut", params=VIEW | {"view": "Raw?"}).status_code == 422

    display = {"exposure": 1.0, "tone_map": VIEW}
    request = {"bake": baked.bake, "view": "front", "looks": [{"display": display}], "precision": "float"}

    def rendered(**more: object) -> bytes:
        url = client.post("/api/renders", json=request | more).headers["location"]
        assert wait_until(client, url, is_done)["state"] == "ready"
        return client.get(f"{url}/frames/0").content

    pictures = {}
    for name in (None, "lin_ap1"):
        (tmp_path / "a.exr").write_bytes(rendered(format="exr", color_space=name))
        exr_image = OpenImageIO.ImageBuf(str(tmp_path / "a.exr"))
        pictures[name] = exr_image.get_pixels(OpenImageIO.FLOAT)
    assert exr_image.spec().getattribute("chromaticities") == pytest.approx(INTEROP_SPACES["lin_ap1_scene"])
    light = np.ascontiguousarray(pictures[None]).reshape(-1, 3)
    converted = light.copy()
    config.convert(converted, "ACEScg")
    np.testing.assert_allclose(pictures["lin_ap1"].reshape(-1, 3), converted, rtol=1e-5)
    light *= 2
    config.apply_view(light, OcioView(**VIEW))
    png = np.asarray(Image.open(io.BytesIO(rendered(format="png"))))
    np.testing.assert_array_equal(png, to_bytes(light.reshape(png.shape)))


def test_unknown_views_are_rejected_before_rendering(client: TestClient, baked: Baked) -> None:
    other = VIEW | {"view": "Film of another house"}
    request = {"bake": baked.bake, "view": "front", "looks": [{}, {"display": {"tone_map": other}}], "format": "png"}
    refused = client.post("/api/renders", json=request)
    assert (refused.status_code, refused.json()["parameter"]) == (422, "/looks/1/display/tone_map")
    assert "Un-tone-mapped" in refused.json()["allowed"]
    assert client.post("/api/renders", json=request | {"format": "exr"}).status_code == 202  # EXR has no tone mapping
    for more in ({"format": "exr", "color_space": "ACEScct"}, {"looks": [{}], "color_space": "ACEScg"}):
        refused = client.post("/api/renders", json=request | more)
        assert (refused.status_code, refused.json()["parameter"]) == (422, "color_space")
    for name in ("\0", "\ud800", "a" * 257):
        asked = json.dumps(request | {"looks": [{}], "format": "exr", "color_space": name})
        headers = {"Content-Type": "application/json"}
        assert client.post("/api/renders", content=asked, headers=headers).status_code == 422
    comparison = {"bake": baked.bake, "view": "front", "look": request["looks"][1]}
    assert client.post("/api/comparisons", json=comparison).json()["parameter"] == "/look/display/tone_map"


def test_config_of_the_server_is_used_by_steps(settings: Settings) -> None:
    bakes = SimpleNamespace(executors=Executors(num_workers=2))
    for arguments, expected in (((CONFIG, "ACEScg"), (CONFIG, "ACEScg")), ((CONFIG, None), (CONFIG,)), ((None,), ())):
        with using_config(*arguments):
            steps = open_steps(settings, cast("Any", None), cast("Any", bakes))
        process = cast("ClusterSteps", steps)._process
        assert process.config == expected
        with using_config(*[*process.config, None][:2]):
            assert config_source() == expected
