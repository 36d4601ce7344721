"""OpenColorIO against itself: what relume shows, tables and exports is what a config's own processors give."""

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
    """Display values by a table: the twin of the editor's shader.

    Args:
        table: as `bake` makes it. (N, N, N, 3)
        light: linear, after exposure. (n, 3)
    """
    roots = np.sqrt(np.maximum(light.astype(np.float64), 0))
    position = np.minimum(np.log1p(GAIN * roots) / (2 * np.log1p(GAIN)), 1) * (SIZE - 1)
    node = np.minimum(position.astype(int), SIZE - 2)
    fraction = position - node
    # from the corner at 0 along the longest part first, to that at 1
    order = np.argsort(-fraction, axis=1, kind="stable")
    steps = np.take_along_axis(fraction, order, axis=1)
    weights = -np.diff(steps, axis=1, prepend=1, append=0)  # of the four corners
    display = np.zeros(light.shape)
    for k in range(4):
        display += weights[:, k, None] * table[tuple(node.T)]
        if k < 3:
            node += order[:, k, None] == _CHANNELS
    return display / 65535


def lights(num: int, stops: tuple[float, float] = (-10, 8)) -> np.ndarray:
    """Of luminances evenly in stops about middle grey, from grey to saturated. (num, 3)"""
    rng = np.random.default_rng(5)
    grey, tint = 0.18 * 2 ** rng.uniform(*stops, (num, 1)), 3 * rng.dirichlet([0.6] * 3, num)
    share = rng.uniform(0, 1, (num, 1))
    return (grey * (share + (1 - share) * tint)).astype(np.float32)


def by_ocio(light: np.ndarray, transform: ocio.Transform) -> np.ndarray:
    """What the config's own processor makes of it."""
    out = light.copy()
    ocio.Config.CreateFromFile(STUDIO).getProcessor(transform).getDefaultCPUProcessor().applyRGB(out)
    return out


def seen(light: np.ndarray, view: OcioView) -> np.ndarray:
    transform = ocio.DisplayViewTransform(src="lin_rec709_scene", display=view.display, view=view.view)
    return by_ocio(light, transform).clip(0, 1)


def test_a_view_is_the_tone_map_that_the_config_has():
    image = lights(40_000).reshape(200, 200, 3)  # more rows than go into one range
    image[0, 0], image[0, 1] = np.nan, -1
    with using_config(STUDIO):
        shown = tone_map(image, 1.5, VIEW)
    black = np.where(np.isnan(image) | (image < 0), 0, image)
    np.testing.assert_allclose(shown, seen((black * 2**1.5).astype(np.float32), VIEW), atol=1e-5)


@pytest.mark.parametrize(
    ("view", "mean", "most"),
    [
        (VIEW, 0.04, 0.6),
        (OcioView("Display P3 - Display", "ACES 2.0 - SDR 100 nits (P3 D65)"), 0.04, 0.6),
        (OcioView("Rec.2100-PQ - Display", HDR), 0.045, 0.3),
        (OcioView("sRGB - Display", "Un-tone-mapped"), 0.04, 0.2),
        (OcioView("Gamma 2.6 P3-D65 - Display", "Un-tone-mapped"), 0.045, 3.0),
    ],
)
def test_a_table_is_the_view_but_for_less_than_a_screen_shows(view, mean, most):
    """In steps of 8 bits: on the mean, and of 999 in 1,000."""
    light = lights(30_000)
    with using_config(STUDIO):
        table, shown = get_config().table(view), tone_map(light[None], 0.0, view, use_table=True)[0]
    np.testing.assert_allclose(shown, sample_lut(table, light), atol=2e-5)
    off = 255 * np.abs(sample_lut(table, light) - seen(light, view))
    assert off.mean() < mean
    assert np.quantile(off, 0.999) < most
    assert off.max() < 15  # a saturated light on the edge of what a display has
    greys = np.repeat(np.geomspace(1e-4, 100, 500, dtype=np.float32)[:, None], 3, axis=1)
    assert 255 * np.abs(sample_lut(table, greys) - seen(greys, view)).max() < 0.2


def test_exported_light_is_the_same_light_to_whoever_reads_the_chromaticities():
    """In each of a config's linear spaces."""
    light = lights(1000, (-10, 0))
    with using_config(STUDIO):
        spaces = [find_space(name) for name in get_config().spaces]
    assert len(spaces) > 15
    for space in spaces:
        found = space.convert_image(light[None])[0]
        wanted = by_ocio(light, ocio.ColorSpaceTransform("lin_rec709_scene", space.name))
        np.testing.assert_allclose(found, wanted, atol=1e-6, err_msg=space.name)
        back = to_rec_709(space.chromaticities)
        back = np.eye(3) if back is None else back
        np.testing.assert_allclose(found @ back.T, light, atol=3e-5, err_msg=space.name)


def test_known_spaces_are_written_as_what_they_are():
    with using_config(STUDIO):
        found = {name: find_space(name) for name in ("lin_ap1", "ACES2065-1", "scene_linear", "Linear V-Gamut")}
        assert find_space(None).interop == "lin_rec709_scene"
    assert [space.name for space in found.values()] == ["ACEScg", "ACES2065-1", "ACEScg", "Linear V-Gamut"]
    assert [space.interop for space in found.values()] == ["lin_ap1_scene", "lin_ap0_scene", "lin_ap1_scene", None]
    assert found["ACES2065-1"].chromaticities == INTEROP_SPACES["lin_ap0_scene"]


def test_a_picture_in_aces_is_read_as_the_light_that_it_was(tmp_path):
    """By relume's own reader of maps; coverage stays coverage."""
    light = np.concatenate([lights(32 * 16, (-6, 4)), np.full((32 * 16, 1), 0.25, np.float32)], 1).reshape(16, 32, 4)
    scene = still_life()
    look = validate({}, default_look(scene.materials))
    with using_config(STUDIO):
        space = find_space("ACES2065-1")
        attributes = build_attributes(Provenance("a", "b", "c"), scene.cameras[0], (32, 16), look, [], space)
        export_exr(tmp_path / "a.exr", lambda *of: light, look, [], attributes, "float", space=space)
    found = read_environment(tmp_path / "a.exr", "a").radiance
    np.testing.assert_allclose(found, light[..., :3], rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("name", ["ACEScct", "Raw", "sRGB - Display", "../../etc/passwd", ""])
def test_no_picture_is_exported_in_what_is_not_linear_light(name):
    with using_config(STUDIO), pytest.raises(ParameterError, match="linear color space"):
        find_space(name)


def test_configs_that_cannot_be_used_say_why_in_one_sentence(tmp_path):
    blind = b"ocio_profile_version: 1\nroles: {default: raw}\ncolorspaces: []\n"
    bad = {"text": b"hello", "empty": b"", "blind.ocio": blind, "bytes.ocio": b"\xf7" * 99, "a.ocioz": b"PK\3\4"}
    asked = r"^RELUME_OCIO is .* give (the path|a config that has displays)"
    for name, text in bad.items():
        (tmp_path / name).write_bytes(text)
    for source in [str(tmp_path / name) for name in (*bad, "gone.ocio", "")] + ["ocio://palace"]:
        with pytest.raises(ParameterError, match=asked) as raised:
            Config(source)
        assert "\n" not in str(raised.value)


def test_an_old_config_is_told_which_of_its_spaces_is_ours(tmp_path, caplog):
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
        grey = np.full((1, 1, 3), 0.25, np.float32)
        np.testing.assert_allclose(tone_map(grey, 0.0, OcioView("Monitor", "Film")), 0.5, atol=1e-5)
        with pytest.raises(ParameterError, match="log says which"):
            config.table(OcioView("Monitor", "Broken"))
        assert str(Path("gone.cube")) in caplog.text
        for view in (OcioView("Monitor", "film"), OcioView("Film", "Film")):
            with pytest.raises(ParameterError, match="one of"):
                tone_map(grey, 0.0, view)
    with pytest.raises(ParameterError, match="RELUME_OCIO"):
        tone_map(grey, 0.0, VIEW)
