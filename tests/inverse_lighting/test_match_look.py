"""Looks matched to pictures of a bake: the lights that made a picture come back."""

from __future__ import annotations

import io
from functools import partial

import numpy as np
import pytest
from matched_looks import matched, relative_error
from PIL import Image
from session_edits import make_look

from relume.core.errors import EditError, ParameterError, SceneError
from relume.image_io.display_transform import DisplayTransform, to_display
from relume.image_io.tone_mapping import tone_map
from relume.image_io.write_image import png_bytes, to_bytes, write_image
from relume.inverse_lighting.match_look import MatchRequest, match_look
from relume.inverse_lighting.painting import Stroke
from relume.inverse_lighting.reference_picture import read_reference
from relume.inverse_lighting.sources import LOCKED_POINTER, load_sources
from relume.output.render_image import render_image, render_small, small_size

SIZE = 40, 30
LIGHTS = {
    "Key/1": {"kind": "point", "position": [0.5, 1.3, 0.5], "emission": [2.0, 1.5, 1.0]},
    "Fill": {
        "kind": "rectangle", "position": [0.9, 1.2, 0.9], "direction": [-1, -1, -1], "size": [0.5, 0.3],
        "emission": [1.0, 2.0, 4.0],
    },
    "Off": {"kind": "point", "position": [0.0, 1.0, 0.0], "enabled": False},
}  # fmt: skip


def look_of(transfer, *, background="map", tone="agx", **lights):
    """A look with the lights; keywords change their fields by name, `environment` too."""

    def change(document):
        document["lights"].update(LIGHTS)
        document["background"].update(kind=background, color=[0.2, 0.3, 0.1])
        document["display"].update(exposure=0.5, tone_map=tone)
        for name, fields in lights.items():
            document["environment" if name == "environment" else "lights"].update(
                fields if name == "environment" else {KEYS[name]: {**document["lights"][KEYS[name]], **fields}}
            )

    return make_look(transfer, change)


KEYS = {"key": "Key/1", "fill": "Fill"}
WANTED = {
    "key": {"intensity": 3.0, "color": [1.0, 0.5, 0.25]},
    "fill": {"intensity": 0.4},
    "environment": {"intensity": 0.6, "color": [0.5, 0.75, 1.0]},
}


def exr_bytes(image, folder):
    write_image(folder / "a.exr", image)
    return (folder / "a.exr").read_bytes()


@pytest.mark.parametrize("background", ["map", "color"])
def test_images_of_sources_sum_to_the_image(gathered, render, background):
    look = look_of(gathered, background=background, **WANTED)
    sources = load_sources(look, render)
    assert sources.pointers == ("/environment", "/lights/Key~11", "/lights/Fill")
    assert relative_error(sources.image(sources.strengths), render(look)) < 1e-4


@pytest.mark.parametrize("background", ["map", "color"])
def test_the_lights_of_a_picture_come_back(gathered, render, tmp_path, background):
    look, wanted = look_of(gathered, background=background), look_of(gathered, background=background, **WANTED)
    result = match_look(look, render, render, SIZE, MatchRequest(reference=exr_bytes(render(wanted), tmp_path)))
    after = matched(look, result)
    assert relative_error(render(after), render(wanted)) < 0.01
    assert result.match.residual < 0.01
    assert after.lights["Key/1"].intensity == pytest.approx(3.0, rel=0.02)
    np.testing.assert_allclose(after.lights["Key/1"].color, [1.0, 0.5, 0.25], rtol=0.02)
    assert after.lights["Fill"].intensity == pytest.approx(0.4, rel=0.05)
    assert after.lights["Off"] == look.lights["Off"]


def test_locked_lights_are_one_image(gathered, render):
    look, rendered = look_of(gathered, **WANTED), []

    def counted(each):
        rendered.append(each)
        return render(each)

    sources = load_sources(look, counted, {"/environment", "/lights/Fill"})
    assert (sources.pointers, len(rendered)) == (("/lights/Key~11", LOCKED_POINTER), 2)
    assert relative_error(sources.image(sources.strengths), render(look)) < 1e-4
    everything = load_sources(look, render, {"/environment", "/lights/Key~11", "/lights/Fill"})
    assert everything.pointers == (LOCKED_POINTER,)
    assert relative_error(everything.image(everything.strengths), render(look)) < 1e-4


def test_an_unknown_lock_is_an_error(gathered, render):
    with pytest.raises(ParameterError, match="/lights/Fill"):
        load_sources(look_of(gathered), render, {"/lights/Off"})


def test_a_reference_renders_nothing_but_the_lights(gathered, render, tmp_path):
    look, rendered = look_of(gathered), []

    def counted(each):
        rendered.append(each)
        return render(each)

    data = exr_bytes(render(look), tmp_path)
    match_look(look, counted, render, SIZE, MatchRequest(reference=data, locked=frozenset({"/environment"})))
    assert [sorted(each.lights) for each in rendered[:2]] == [["Key/1"], ["Fill"]]
    assert len(rendered) == 2 * 3  # two free lights and the locked one; once more for the report


def test_a_picture_of_full_size_matches_small_images(gathered, tmp_path):
    """Small images are samples of the picture, whose edges and highlights are averages in a reference."""
    look, wanted = look_of(gathered), look_of(gathered, **WANTED)

    def render(look):
        return render_small(gathered, "front", look, 20)

    result = match_look(
        look,
        render,
        partial(render_image, gathered, "front"),
        small_size(gathered, "front", 20),
        MatchRequest(reference=exr_bytes(render_image(gathered, "front", wanted), tmp_path)),
    )
    assert result.match.residual < 0.04  # 0.10 without averages
    assert matched(look, result).lights["Key/1"].intensity == pytest.approx(3.0, rel=0.1)


@pytest.mark.parametrize("tone", ["none", "agx", "filmic"])
def test_the_tone_map_of_the_view_is_inverted(gathered, render, tone):
    look, wanted = look_of(gathered, tone=tone), look_of(gathered, tone=tone, **WANTED)
    display = to_bytes(tone_map(render(wanted), 0.5, tone))
    result = match_look(look, render, render, SIZE, MatchRequest(reference=png_bytes(display)))
    assert relative_error(render(matched(look, result)), render(wanted)) < 0.02


def test_the_exposure_of_a_picture_can_be_free(gathered, render, tmp_path):
    """Ten times as bright as this look can tell: without exposure, the match is the current look."""
    look = look_of(gathered)
    data = exr_bytes(10 * render(look), tmp_path)
    fitted = match_look(look, render, render, SIZE, MatchRequest(reference=data, fits_exposure=True))
    assert (fitted.operations, fitted.match.residual) == ([], pytest.approx(0.0, abs=1e-5))
    absolute = match_look(look, render, render, SIZE, MatchRequest(reference=data))
    assert absolute.match.stops["/environment"] == pytest.approx(np.log2(10), abs=0.02)


def test_a_picture_counts_only_in_its_strokes(gathered, render, tmp_path):
    look, wanted = look_of(gathered), look_of(gathered, **WANTED)
    picture = render(wanted).copy()
    picture[:, 20:] = 100.0

    def left_half(size):
        mask = np.zeros(size[::-1], np.float32)
        mask[:, : size[0] // 2] = 1.0
        return [Stroke("reference", mask)]

    request = MatchRequest(left_half, exr_bytes(picture, tmp_path))
    assert match_look(look, render, render, SIZE, request).match.residual < 0.02


def test_clipped_and_transparent_pixels_have_no_weight(gathered):
    pixels = np.full((4, 4, 4), 128, np.uint8)
    pixels[..., 3] = 255
    pixels[0, 0] = 255
    pixels[1, 1, 3] = 0
    target = read_reference(png_bytes(pixels), look_of(gathered, tone="none").display, (4, 4))
    expected = np.full((4, 4), 1.0)
    expected[0, 0] = expected[1, 1] = 0.0
    np.testing.assert_array_equal(target.weights, expected)
    np.testing.assert_allclose(target.radiance[2, 2], 0.21586 / 2**0.5, rtol=1e-3)


@pytest.mark.parametrize("contrast", [1.0, 1.3])
def test_white_balance_and_contrast_of_the_display_are_removed(gathered, contrast):
    display = look_of(gathered).display.model_copy(
        update={"exposure": 0.4, "temperature": 3200.0, "tint": 12.0, "contrast": contrast}
    )
    transform = DisplayTransform(0.4, "agx", 3200.0, 12.0, contrast=contrast)
    radiance = np.broadcast_to(np.array([0.3, 0.2, 0.12], np.float32), (4, 4, 3))
    shown = to_bytes(to_display(radiance, transform))
    target = read_reference(png_bytes(shown), display, (4, 4))
    np.testing.assert_allclose(target.radiance, radiance, rtol=0.04)


@pytest.mark.parametrize(("size", "columns"), [((8, 4), slice(2, 6)), ((4, 4), slice(0, 4))])
def test_another_aspect_ratio_is_cropped_about_the_center(gathered, size, columns):
    picture = np.arange(size[0], dtype=np.uint8)[None, :, None] * np.ones((size[1], 1, 3), np.uint8) * 20
    target = read_reference(png_bytes(picture), look_of(gathered, tone="none").display, (4, 4))
    inner = read_reference(png_bytes(picture[:, columns]), look_of(gathered, tone="none").display, (4, 4))
    np.testing.assert_allclose(target.radiance, inner.radiance, rtol=1e-5)


def test_texels_that_are_not_numbers_have_no_weight(gathered, tmp_path):
    picture = np.ones((4, 4, 3), np.float32)
    picture[1, 2, 0] = np.nan
    target = read_reference(exr_bytes(picture, tmp_path), look_of(gathered).display, (2, 2))
    np.testing.assert_allclose(target.weights, [[1.0, 0.75], [1.0, 1.0]])
    np.testing.assert_allclose(target.radiance, 1.0)


def test_jpeg_is_read(gathered):
    file = io.BytesIO()
    Image.new("RGB", (16, 12), (128, 128, 128)).save(file, "JPEG")
    target = read_reference(file.getvalue(), look_of(gathered, tone="none").display, (4, 3))
    np.testing.assert_allclose(target.radiance, 0.21586 / 2**0.5, rtol=0.02)


@pytest.mark.parametrize("data", [b"", b"no picture", b"\x76\x2f\x31\x01", b"#?RADIANCE\n"])
def test_a_damaged_picture_is_an_error(gathered, data):
    with pytest.raises(SceneError, match="reference picture"):
        read_reference(data, look_of(gathered).display, (4, 4))


def test_shadow_catchers_are_refused(gathered, render):
    look = look_of(gathered)
    floor = look.materials["Floor"].model_copy(update={"shadow_catcher": True})
    with pytest.raises(EditError, match="shadow catcher"):
        load_sources(look.model_copy(update={"materials": {**look.materials, "Floor": floor}}), render)


@pytest.mark.slow
def test_the_rotation_of_the_environment_comes_back(gathered, render, tmp_path):
    look, wanted = look_of(gathered), look_of(gathered, environment={"rotation": 130.0, "intensity": 0.5})
    data = exr_bytes(render(wanted), tmp_path)
    result = match_look(look, render, render, SIZE, MatchRequest(reference=data, rotates=True))
    assert matched(look, result).environment.rotation == pytest.approx(130.0, abs=2.0)
    locked = match_look(
        look, render, render, SIZE, MatchRequest(reference=data, rotates=True, locked=frozenset(["/environment"]))
    )
    assert matched(look, locked).environment == look.environment
