"""IES files of USD lights: their profile, intensity and azimuth; exports; files outside the stage's folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export_scenes import export_of
from ies_files import cosine_web, ies_text
from usd_text import WHITE, Files, quad, usda

from relume.assets.ies.ies_store import IES_FILES, load_web, store_ies_files
from relume.export.write_usd import omitted_from_usd, write_usd
from relume.look import validate
from relume.look.document import default_look
from relume.scene.model import Scene
from relume.scene_io.import_scene import import_scene
from relume.scene_io.referenced_files import Folder

pytest.importorskip("pxr.Usd")

POLAR, AZIMUTH = np.linspace(0, 180, 73), np.arange(0, 360, 30.0)
SKEW = ies_text(np.roll(cosine_web(2, POLAR, AZIMUTH), 3, axis=0), POLAR, AZIMUTH).encode()  # bright toward C90
CANDELA = 1500.0
MEAN = (1 / 6) / 1.5  # of cos² below the horizon, over the maximum at C90
SPHERE = "float inputs:radius = 0.5\nfloat inputs:intensity = 4\nasset inputs:shaping:ies:file = @{}@"
INTENSITY = 4 * np.pi * 0.5**2  # W/sr without the file


def stage(inputs: str, kind: str = "SphereLight") -> bytes:
    light = f"""
def {kind} "Key" (prepend apiSchemas = ["ShapingAPI"])
{{
    {inputs}
    double3 xformOp:translate = (1, 2, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}"""
    return usda(quad() + light)


def lit(inputs: str, kind: str = "SphereLight", name: str = "ies/web.ies") -> Scene:
    return import_scene(stage(inputs.format(name), kind), "scene", WHITE, Files({"ies/web.ies": SKEW}))


def fields(scene: Scene) -> dict[str, Any]:
    (light,) = scene.lights
    return light.fields


@pytest.mark.parametrize(
    ("inputs", "expected"),
    [
        ("", INTENSITY * CANDELA),
        ("bool inputs:shaping:ies:normalize = 1", INTENSITY / MEAN),
    ],
)
def test_the_intensity_of_a_light_is_that_of_its_file(inputs: str, expected: float) -> None:
    scene = lit(f"{SPHERE}\n{inputs}")
    light = fields(scene)
    assert (light["kind"], light["position"], light["profile"]) == ("point", [1, 2, 3], IES_FILES.name_of(SKEW))
    assert light["emission"] == pytest.approx([expected] * 3, rel=2e-3)
    assert [file.name for file in scene.ies_files] == ["web.ies"]
    assert not scene.warnings


def test_a_light_with_a_cone_is_a_spot_with_the_file() -> None:
    light = fields(lit(f"{SPHERE}\nfloat inputs:shaping:cone:angle = 40"))
    assert (light["kind"], light["cone"], light["profile"]) == ("spot", [40, 40], IES_FILES.name_of(SKEW))


def test_c0_is_x_of_the_light_and_c90_y() -> None:
    """The light emits along −Z of the world; its intensity is largest toward +Y."""
    light = fields(lit(SPHERE))
    assert light["direction"] == [0, 0, -1]
    assert light["rotation"] % 360 == pytest.approx(180)  # at 0, C0 is −X


@pytest.mark.parametrize(
    ("inputs", "kind", "warning"),
    [
        (f"{SPHERE}\nfloat inputs:shaping:ies:angleScale = 0.5", "SphereLight", "The angle scale of the IES file"),
        ("float inputs:width = 1\nasset inputs:shaping:ies:file = @{}@", "RectLight", "points and spots can have one"),
    ],
)
def test_the_rest_is_a_warning(inputs: str, kind: str, warning: str) -> None:
    assert any(warning in text for text in lit(inputs, kind).warnings)


def test_a_damaged_file_costs_its_shape_alone() -> None:
    scene = import_scene(stage(SPHERE.format("bad.ies")), "scene", WHITE, Files({"bad.ies": b"IESNA91\nno tilt"}))
    assert fields(scene)["kind"] == "sphere"
    assert any("was skipped: IES file 'bad.ies' has no line TILT=" in text for text in scene.warnings)


@pytest.mark.parametrize("name", ["../web.ies", "/etc/hostname", "missing.ies", "http://host/web.ies"])
def test_files_outside_the_folder_are_not_read(name: str, tmp_path: Path) -> None:
    (tmp_path / "web.ies").write_bytes(SKEW)
    (tmp_path / "inner").mkdir()
    scene = import_scene(stage(SPHERE.format(name)), "scene", WHITE, Folder(tmp_path / "inner"))
    assert fields(scene)["kind"] == "sphere"
    assert scene.ies_files == ()
    assert any("IES file" in text or name.rpartition("/")[2] in text for text in scene.warnings)


@pytest.mark.parametrize(
    "light",
    [
        {"kind": "point", "direction": [0.3, -1.0, 0.2], "rotation": 40.0},
        {"kind": "spot", "direction": [0.0, -1.0, 0.0], "rotation": 300.0, "cone": [30.0, 60.0]},
    ],
)
def test_an_export_is_read_again(light: dict[str, Any], tmp_path: Path) -> None:
    scene = lit(SPHERE)
    with IES_FILES.with_search_folder(tmp_path / "assets") as folder:
        store_ies_files(folder, scene.ies_files)
        profile = IES_FILES.name_of(SKEW)
        own = {**light, "position": [1.0, 2.0, 3.0], "emission": [2.0, 1.0, 3.0], "profile": profile}
        export = export_of(scene, {"lights": {"Key": own}})
        assert not any("IES" in sentence for sentence in omitted_from_usd(export))
        write_usd(export, tmp_path / "out.usdz")
        copy = import_scene(tmp_path / "out.usdz", "copy")
        (actual,) = (each.fields for each in copy.lights if each.name == "Key")
        assert (actual["kind"], actual["profile"]) == (light["kind"], profile)
        assert actual["emission"] == pytest.approx(own["emission"], rel=1e-4)
        assert actual["rotation"] % 360 == pytest.approx(light["rotation"], abs=1e-3)
        assert copy.ies_files[0].data == SKEW
        look = validate({}, default_look(copy.materials, copy.lights))
        assert look.lights["Key"].profile == profile
        assert load_web(profile).max() == 1
