"""OpenColorIO against itself: displayed, tabulated and exported values equal those of a config's own processors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import PyOpenColorIO as ocio  # noqa: N813
import pytest
from numpy.typing import NDArray
from tiny_scenes import still_life

from relume.assets.environments.read_environment import read_environment
from relume.core.errors import ParameterError
from relume.image_io.ocio.active_config import get_config, using_config
from relume.image_io.ocio.config import Config
from relume.image_io.ocio.lut import GAIN, SIZE
from relume.image_io.ocio.view import OcioView
from relume.image_io.primaries import INTEROP_SPACES, to_rec_709
from relume.image_io.tone_mapping import tone_map
from relume.look import default_look, validate
from relume.output.exr.color_space import find_space
from relume.output.exr.export import export_exr
from relume.output.exr.metadata import Provenance, build_attributes

STUDIO = "ocio://studio-config-latest"
SDR, HDR = "ACES 2.0 - SDR 100 nits (Rec.709)", "ACES 2.0 - HDR 1000 nits (P3 D65)"
VIEW = OcioView("sRGB - Display", SDR)
OLD = """ocio_profile_version: 1
roles: {default: raw, scene_linear: lin}
displays:
  Monitor: [!<View> {name: Film, colorspace: film}, !<View> {name: Broken, colorspace: broken}]
colorspaces:
  - !<ColorSpace> {name: lin}
  - !<ColorSpace> {name: raw, isdata: true}
  - !<ColorSpace> {name: film, from_reference: !<ExponentTransform> {value: [0.5, 0.5, 0.5, 1]}}
  - !<ColorSpace> {name: broken, from_reference: !<FileTransform> {src: gone.cube}}
"""


_CHANNELS = np.arange(3)
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U16 = NDArray[np.uint16]


def sample_lut(table: U16, light: F32) -> F64:
    """Display values by a table: the reference of the editor's shader.

    Args:
        table: from `bake`. (N, N, N, 3)
        light: linear, after exposure. (n, 3)
    """
    roots = np.sqrt(np.maximum(light.astype(np.float64), 0))
    position = np.minimum(np.log1p(GAIN * roots) / (2 * np.log1p(GAIN)), 1) * (SIZE - 1)
    node = np.minimum(position.astype(int), SIZE - 2)
    fraction = position - node
    # from the corner at 0 along the largest coordinate first, to the corner at 1
    order = np.argsort(-fraction, axis=1, kind="stable")
    steps = np.take_along_axis(fraction, order, axis=1)
    weights = -np.diff(steps, axis=1, prepend=1, append=0)  # weights of the four corners
    display = np.zeros(light.shape)
    for k in range(4):
        display += weights[:, k, None] * table[tuple(node.T)]
        if k < 3:
            node += order[:, k, None] == _CHANNELS
    return display / 65535


def lights(num: int, stops: tuple[float, float] = (-10, 8)) -> np.ndarray:
    """Colors with luminances uniform in stops around middle gray, from gray to saturated. (num, 3)"""
    rng = np.random.default_rng(5)
    gray, tint = 0.18 * 2 ** rng.uniform(*stops, (num, 1)), 3 * rng.dirichlet([0.6] * 3, num)
    share = rng.uniform(0, 1, (num, 1))
    return (gray * (share + (1 - share) * tint)).astype(np.float32)


def by_ocio(light: np.ndarray, transform: ocio.Transform) -> np.ndarray:
    """Apply the config's own processor."""
    out = light.copy()
    ocio.Config.CreateFromFile(STUDIO).getProcessor(transform).getDefaultCPUProcessor().applyRGB(out)
    return out


def display_values(light: np.ndarray, view: OcioView) -> np.ndarray:
    transform = ocio.DisplayViewTransform(src="lin_rec709_scene", display=view.display, view=view.view)
    return by_ocio(light, transform).clip(0, 1)


def test_a_view_is_the_tone_map_of_the_config():
    image = lights(40_000).reshape(200, 200, 3)  # more rows than one range of a kernel
    image[0, 0], image[0, 1] = np.nan, -1
    with using_config(STUDIO):
        shown = tone_map(image, 1.5, VIEW)
    black = np.where(np.isnan(image) | (image < 0), 0, image)
    np.testing.assert_allclose(shown, display_values((black * 2**1.5).astype(np.float32), VIEW), atol=1e-5)


@pytest.mark.parametrize(
    ("view", "mean", "max_error"),
    [
        (VIEW, 0.04, 0.6),
        (OcioView("Display P3 - Display", "ACES 2.0 - SDR 100 nits (P3 D65)"), 0.04, 0.6),
        (OcioView("Rec.2100-PQ - Display", HDR), 0.045, 0.3),
        (OcioView("sRGB - Display", "Un-tone-mapped"), 0.04, 0.2),
        (OcioView("Gamma 2.6 P3-D65 - Display", "Un-tone-mapped"), 0.045, 3.0),
    ],
)
def test_a_table_equals_the_view_within_display_precision(view, mean, max_error):
    """In 8-bit steps: the mean, and the 99.9 % quantile."""
    light = lights(30_000)
    with using_config(STUDIO):
        table, shown = get_config().table(view), tone_map(light[None], 0.0, view, use_table=True)[0]
    np.testing.assert_allclose(shown, sample_lut(table, light), atol=2e-5)
    difference = 255 * np.abs(sample_lut(table, light) - display_values(light, view))
    assert difference.mean() < mean
    assert np.quantile(difference, 0.999) < max_error
    assert difference.max() < 15  # a saturated color at the edge of the display's gamut
    grays = np.repeat(np.geomspace(1e-4, 100, 500, dtype=np.float32)[:, None], 3, axis=1)
    assert 255 * np.abs(sample_lut(table, grays) - display_values(grays, view)).max() < 0.2


def test_exported_light_is_unchanged_by_its_chromaticities():
    """In each linear space of the config."""
    light = lights(1000, (-10, 0))
    with using_config(STUDIO):
        spaces = [find_space(name) for name in get_config().spaces]
    assert len(spaces) > 15
    for space in spaces:
        exported = space.convert_image(light[None])[0]
        expected = by_ocio(light, ocio.ColorSpaceTransform("lin_rec709_scene", space.name))
        np.testing.assert_allclose(exported, expected, atol=1e-6, err_msg=space.name)
        back = to_rec_709(space.chromaticities)
        back = np.eye(3) if back is None else back
        np.testing.assert_allclose(exported @ back.T, light, atol=3e-5, err_msg=space.name)


def test_known_spaces_are_written_with_their_names():
    with using_config(STUDIO):
        spaces = {name: find_space(name) for name in ("lin_ap1", "ACES2065-1", "scene_linear", "Linear V-Gamut")}
        assert find_space(None).interop == "lin_rec709_scene"
    assert [space.name for space in spaces.values()] == ["ACEScg", "ACES2065-1", "ACEScg", "Linear V-Gamut"]
    assert [space.interop for space in spaces.values()] == ["lin_ap1_scene", "lin_ap0_scene", "lin_ap1_scene", None]
    assert spaces["ACES2065-1"].chromaticities == INTEROP_SPACES["lin_ap0_scene"]


def test_an_exported_aces_image_is_read_back(tmp_path):
    """By relume's own reader of maps; coverage is unchanged."""
    light = np.concatenate([lights(32 * 16, (-6, 4)), np.full((32 * 16, 1), 0.25, np.float32)], 1).reshape(16, 32, 4)
    scene = still_life()
    look = validate({}, default_look(scene.materials))
    with using_config(STUDIO):
        space = find_space("ACES2065-1")
        attributes = build_attributes(Provenance("a", "b", "c"), scene.cameras[0], (32, 16), look, [], space)
        export_exr(tmp_path / "a.exr", lambda *arguments: light, look, [], attributes, "float", space=space)
    radiance = read_environment(tmp_path / "a.exr", "a").radiance
    np.testing.assert_allclose(radiance, light[..., :3], rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("name", ["ACEScct", "Raw", "sRGB - Display", "../../etc/passwd", ""])
def test_images_are_exported_only_in_linear_spaces(name):
    with using_config(STUDIO), pytest.raises(ParameterError, match="linear color space"):
        find_space(name)


def test_unusable_configs_report_the_reason(tmp_path):
    blind = b"ocio_profile_version: 1\nroles: {default: raw}\ncolorspaces: []\n"
    bad = {"text": b"hello", "empty": b"", "blind.ocio": blind, "bytes.ocio": b"\xf7" * 99, "a.ocioz": b"PK\3\4"}
    requested = r"^RELUME_OCIO is .* give (the path|a config that has displays)"
    for name, text in bad.items():
        (tmp_path / name).write_bytes(text)
    for source in [str(tmp_path / name) for name in (*bad, "gone.ocio", "")] + ["ocio://palace"]:
        with pytest.raises(ParameterError, match=requested) as raised:
            Config(source)
        assert "\n" not in str(raised.value)


def test_an_old_config_logs_the_matching_space(tmp_path, caplog):
    path = tmp_path / "config.ocio"
    path.write_text(OLD)
    with pytest.raises(ParameterError, match=r"RELUME_OCIO_SPACE .* lin, raw, film, broken"):
        Config(str(path))
    for name in ("raw", "gone"):
        with pytest.raises(ParameterError, match="RELUME_OCIO_SPACE"):
            Config(str(path), name)
    with using_config(str(path), "scene_linear"):
        config = get_config()
        assert (config.working, config.displays, config.spaces) == ("lin", {"Monitor": ("Film", "Broken")}, ("lin",))
        gray = np.full((1, 1, 3), 0.25, np.float32)
        np.testing.assert_allclose(tone_map(gray, 0.0, OcioView("Monitor", "Film")), 0.5, atol=1e-5)
        with pytest.raises(ParameterError, match="log names it"):
            config.table(OcioView("Monitor", "Broken"))
        assert str(Path("gone.cube")) in caplog.text
        for view in (OcioView("Monitor", "film"), OcioView("Film", "Film")):
            with pytest.raises(ParameterError, match="one of"):
                tone_map(gray, 0.0, view)
    with pytest.raises(ParameterError, match="RELUME_OCIO"):
        tone_map(gray, 0.0, VIEW)
