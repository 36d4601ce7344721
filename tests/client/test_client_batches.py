"""Batches by the client: names of the server, no waiting, several views, contact sheets, light mixes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from PIL import Image
from test_client_calls import displayed, sigma_look

from relume_client import Bake, Client, ProblemError, ServerVersionError
from relume_client.transport import file_name

LIGHT = {"intensity": 1.0, "color": [1.0, 1.0, 1.0], "enabled": True, "emission": [1.0, 1.0, 1.0]}
LIGHTS: dict[str, Any] = {
    "Key": {"kind": "point", "position": [1.0, 2.0, 3.0], **LIGHT},
    "Sun": {"kind": "directional", "direction": [0.0, -1.0, 0.0], **LIGHT},
}
MIX: dict[str, Any] = {
    "format": "relume light mix",
    "version": 1,
    "scene": "Still life",
    "units": {"point": "W/sr"},
    "kinds": {"Key": "point", "Sun": "point", "Fill": "spot"},
    "lights": {name: {**LIGHT, "intensity": 0.5, "emission": [3.0, 2.0, 1.0]} for name in ("Key", "Sun", "Fill")},
    "environment": {"intensity": 2.0, "color": [1.0, 0.5, 0.25], "rotation": 90.0, "map": "studio"},
}


def test_files_have_the_names_of_the_template(bake: Bake, tmp_path: Path) -> None:
    looks, views = [sigma_look(0.3), sigma_look(0.4)], [{"view": "front", "bake": bake.id}]
    template = "{view}_{look}.{frame:04}.png"
    options: dict[str, Any] = {"look_names": ["Day", "灯/x"], "start_frame": 7, "views": views}
    files = bake.render(looks, tmp_path / "new", file_name=template, **options)
    names = ["front_Day.0007.png", "front_灯-x.0008.png"]
    assert files == [tmp_path / "new" / name for name in names]
    for file, radiance in zip(files, (0.8, 0.9), strict=True):
        np.testing.assert_array_equal(np.asarray(Image.open(file)), displayed(radiance))


def test_a_render_goes_on_without_its_client_and_is_saved_later(client: Client, bake: Bake, tmp_path: Path) -> None:
    submitted = bake.submit([sigma_look(0.3)], "png", priority=2, name="Shot")
    assert submitted.info["priority"] == 2
    render = client.render(submitted.id).wait(timeout=30)
    (file,) = render.save_named(tmp_path)
    assert (file.name, render.info["state"]) == ("Shot.png", "ready")
    np.testing.assert_array_equal(np.asarray(Image.open(file)), displayed(0.8))
    render.delete()
    with pytest.raises(ProblemError, match="there is no render"):
        client.render(submitted.id)


def test_contact_sheet_is_one_file(bake: Bake, tmp_path: Path) -> None:
    sheet = bake.contact_sheet([sigma_look(0.3), sigma_look(0.4)], tmp_path / "sheet.png")
    with Image.open(sheet) as image:
        assert image.size == (2 * (160 + 12) + 12, 96 + 24 + 2 * 12)


def test_a_light_mix_sets_lights_by_name_and_leaves_materials_alone(bake: Bake) -> None:
    look = bake.look({**sigma_look(0.3), "lights": LIGHTS})
    with pytest.warns(UserWarning, match="light") as warned:
        mixed: Any = bake.with_light_mix(look, MIX).to_document()
    assert [str(warning.message) for warning in warned] == [
        "The light mix has values for lights that the scene does not have: 'Fill'.",
        "These lights are of another kind in the scene and keep its emission: 'Sun'.",
    ]
    document: Any = look.to_document()
    assert mixed["materials"] == document["materials"]
    assert mixed["lights"]["Key"] == {**document["lights"]["Key"], **MIX["lights"]["Key"]}
    assert mixed["lights"]["Sun"] == {**document["lights"]["Sun"], "intensity": 0.5}
    assert list(mixed["lights"]) == ["Key", "Sun"]
    assert mixed["environment"] == {**document["environment"], **MIX["environment"]}
    with pytest.raises(ProblemError, match="version"):
        bake.with_light_mix(look, {**MIX, "version": 2})
    with pytest.raises(ProblemError, match="/mix/format"):
        bake.with_light_mix(look, {"lights": {}})
    with pytest.raises(ValueError, match="with_light_mix"):
        look.update(MIX)


@pytest.mark.parametrize("name", ["../x.png", "a/b.png", "..", "", "C:x.png", "a\\b.png", "%2e%2e%2fx", ".bashrc"])
def test_names_that_are_paths_are_rejected(name: str) -> None:
    for header in (f'attachment; filename="{name}"', f"attachment; filename*=utf-8''{name}"):
        response = httpx.Response(200, headers={"content-disposition": header.encode()})
        if name != "%2e%2e%2fx" or "*" in header:
            with pytest.raises(ServerVersionError, match="none for a file here"):
                file_name(response)
