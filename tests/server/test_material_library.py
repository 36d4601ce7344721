"""The material library over REST."""

import io

import numpy as np
import pytest
from fastapi.testclient import TestClient
from PIL import Image

from relume.look.library import presets
from relume.output.material_previews.library_sheet import library_preview_png, render


def test_thumbnail_shows_a_ball(client: TestClient) -> None:
    preset = presets()[0]
    answer = client.get(f"/api/materials/{preset.id}/thumbnail.png")
    assert answer.headers["content-type"] == "image/png"
    ball = np.asarray(Image.open(io.BytesIO(answer.content)), int)
    assert ball.shape == (64, 64, 3)
    assert ball[16:48, 16:48].std() > 3 * max(1, ball[:3].std())
    assert client.get("/api/materials/low_cooktorrance_E2/nothing/thumbnail.png").status_code == 404


def test_stored_thumbnails_equal_new_renders() -> None:
    """The first material of each model and the last one: changed fits or lighting require all thumbnails again."""
    by_model = {preset.model: preset for preset in reversed(presets())}
    for preset in (*by_model.values(), presets()[-1]):
        png = library_preview_png(preset.id)
        assert png is not None
        ahead = np.asarray(Image.open(io.BytesIO(png)), int)
        difference = np.abs(ahead - render(preset).astype(int))
        assert difference.mean() < 2, preset.id  # the error of lossy encoding, in units of 1/255


@pytest.mark.parametrize("table", ["ngan", "low"])
def test_map_point_between_materials_is_a_material(client: TestClient, table: str) -> None:
    points = client.get("/api/materials/map", params={"table": table}).json()["points"]
    f0, sigma = (float(np.median([point[axis] for point in points])) for axis in ("f0", "sigma"))
    terms = client.get("/api/materials/map/at", params={"f0": f0, "sigma": sigma, "table": table}).json()
    assert [term["model"] for term in terms] == ["lambert", "cook_torrance"]
    assert terms[1]["params"]["sigma"] == pytest.approx(sigma, rel=1e-6)
    index = terms[1]["params"]["ior"] + 1j * terms[1]["params"]["extinction"]
    assert abs((index - 1) / (index + 1)) ** 2 == pytest.approx(f0, rel=1e-6)


@pytest.mark.parametrize(("f0", "sigma"), [("nan", "0.1"), ("2", "0.1"), ("0.1", "0"), ("0.1", "inf"), ("x", "0.1")])
def test_invalid_map_point_is_rejected(client: TestClient, f0: str, sigma: str) -> None:
    assert client.get("/api/materials/map/at", params={"f0": f0, "sigma": sigma}).status_code == 422
