"""Lights with IES webs and gobos against closed forms and the reference."""

import numpy as np
import pytest
from ies_files import cosine_web, ies_text
from PIL import Image
from session_edits import BUDGET
from tiny_scenes import make_camera, make_surface_points, make_tiny_scene, quad

from relume.assets.ies.ies_store import IES_FILES, load_web, store_ies
from relume.assets.ies.read_ies import read_ies
from relume.brdf.texture_slots import IMAGES
from relume.core.cache import Cache
from relume.core.errors import ParameterError
from relume.images.image_store import load_gobo, store
from relume.lights.local_lights import emitter_geometry, make_light_strata, prepare_local_lights
from relume.live.opened.openers import open_bake
from relume.look import LightGeometry, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.raytrace.intensity_table import intensity_table, project_gobo
from relume.raytrace.local_light_visibility import compute_irradiance
from relume.reference import reference_image
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

POLAR, AZIMUTH = np.linspace(0, 180, 361), np.arange(0, 361, 5.0)
POSITION = (0.2, 2.0, -0.1)
AXIS = np.array([0.3, -1.0, 0.2]) / np.linalg.norm([0.3, -1.0, 0.2])


def checker(side=64, fields=8):
    tiles = (np.indices((side, side)) * fields // side).sum(axis=0) % 2
    return np.repeat((255 * tiles).astype(np.uint8)[..., None], 3, axis=2)


@pytest.fixture(scope="module")
def assets(tmp_path_factory):
    """Names of IES files and images in looks."""
    folder, names = tmp_path_factory.mktemp("directional"), {}
    with IES_FILES.with_search_folder(folder / "ies") as webs, IMAGES.with_search_folder(folder / "images") as library:
        for name, text in {
            "symmetric": ies_text(cosine_web(4, POLAR), POLAR),
            "skew": ies_text(cosine_web(2, POLAR, AZIMUTH), POLAR, AZIMUTH),
            "one side": ies_text(np.roll(cosine_web(2, POLAR, AZIMUTH[:-1]), 20, axis=0), POLAR, AZIMUTH[:-1]),
        }.items():
            (folder / f"{name}.ies").write_text(text)
            names[name] = store_ies(webs, folder / f"{name}.ies", name).reference
        colored = checker()
        colored[:32, :32] = 255, 20, 0
        colored[32:, 40:] = 0, 90, 255
        for name, pixels in {"checker": checker(), "colored": colored, "black": 0 * checker()}.items():
            Image.fromarray(pixels).save(folder / f"{name}.png")
            names[name] = store(library, folder / f"{name}.png", name).texture
        yield names


def directions(count):
    vectors = np.random.default_rng(1).normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def intensity(geometry, away, table):
    """Intensity of a light of unit emission in unit directions, from the irradiance of points that face it."""
    light = prepare_local_lights(geometry, intensity_table=table)
    points = np.array(geometry.position) + 1.5 * away
    receivers = make_surface_points(points.astype(np.float32), -away.astype(np.float32))
    visible = np.full((len(points), 1), 255, np.uint8)
    return 1.5**2 * compute_irradiance(light, make_light_strata(light, 64), receivers, visible)


def test_a_symmetric_web_is_a_power_of_the_cosine_about_any_direction(assets):
    geometry = LightGeometry("point", POSITION, tuple(3 * AXIS), rotation=50.0, profile=assets["symmetric"])
    table, away = intensity_table(180, load_web(assets["symmetric"]), None), directions(2000)
    np.testing.assert_allclose(intensity(geometry, away, table), np.maximum(away @ AXIS, 0) ** 4, atol=1e-4)


@pytest.mark.parametrize("rotation", [0.0, 90.0, -30.0])
def test_azimuths_of_a_downward_web_start_at_x_and_rotate(assets, rotation):
    """C0 is +X; a positive rotation turns the web from +X toward +Z."""
    geometry = LightGeometry("point", POSITION, rotation=rotation, profile=assets["skew"])
    table, away = intensity_table(180, load_web(assets["skew"]), None), directions(2000)
    azimuth = np.arctan2(away[:, 2], away[:, 0]) - np.radians(rotation)
    expected = np.maximum(-away[:, 1], 0) ** 2 * (1 + np.cos(azimuth) / 2) / 1.5
    np.testing.assert_allclose(intensity(geometry, away, table), expected, atol=2e-3)


TO_X, TO_Z = "+X -X", "+Z -Z"


@pytest.mark.parametrize(
    ("azimuth", "candela", "bright"),
    [
        ((0, 90, 180, 270), (1, 0, 0, 0), "+X"),
        ((0, 90, 180, 270), (0, 1, 0, 0), "-Z"),
        ((0, 90, 180, 270), (0, 0, 1, 0), "-X"),
        ((0, 90, 180, 270), (0, 0, 0, 1), "+Z"),
        ((0, 90, 180), (1, 0, 0), "+X"),
        ((0, 90, 180), (0, 1, 0), TO_Z),
        ((90, 180, 270), (1, 0, 0), "-Z"),
        ((90, 180, 270), (0, 0, 1), "+Z"),
        ((90, 180, 270), (0, 1, 0), TO_X),
        ((0, 90), (1, 0), TO_X),
        ((0, 90), (0, 1), TO_Z),
    ],
)
def test_azimuths_are_counterclockwise_from_above(azimuth, candela, bright, tmp_path):
    """A luminaire that points down and emits toward one side: C0 is +X, C90 −Z, C180 −X, C270 +Z."""
    polar = (0, 90)
    (tmp_path / "side.ies").write_text(ies_text(np.outer(candela, np.ones(2)), polar, azimuth))
    web, _ = read_ies(tmp_path / "side.ies", "Side")
    toward = {"+X": (1, 0), "-X": (-1, 0), "+Z": (0, 1), "-Z": (0, -1)}
    away = np.array([(x, -1.0, z) for x, z in toward.values()]) / np.sqrt(2)
    values = intensity(LightGeometry("point", POSITION), away, intensity_table(180, web.relative_intensity, None))
    np.testing.assert_allclose(values, [float(name in bright) for name in toward], atol=2e-3)


def test_a_web_keeps_the_sum_over_all_directions(assets):
    """∫ I dω = 2π / 3 · 1 / 1.5 of the cosine squared; the part of cos φ cancels."""
    geometry = LightGeometry("point", POSITION, tuple(AXIS), profile=assets["skew"])
    k = np.arange(20_000) + 0.5
    y, azimuth = 1 - 2 * k / len(k), np.pi * (1 + 5**0.5) * k
    radius = np.sqrt(1 - y**2)
    away = np.stack([radius * np.cos(azimuth), y, radius * np.sin(azimuth)], axis=1)
    table = intensity_table(180, load_web(assets["skew"]), None)
    assert 4 * np.pi * intensity(geometry, away, table).mean() == pytest.approx(2 * np.pi / 3 / 1.5, rel=1e-3)


def test_edges_of_a_gobo_lie_where_perspective_projects_them(assets):
    """A spot of 45° at height 2 shows 8 fields on 4 m of floor, with u toward −X and v toward −Z."""
    geometry = LightGeometry("spot", (0.0, 2.0, 0.0), (0.0, -1.0, 0.0), (44.9, 45.0), gobo=assets["checker"])
    gobo = project_gobo(load_gobo(assets["checker"]), 45.0)
    assert not gobo.is_colored
    x, z = np.random.default_rng(2).uniform(-1.35, 1.35, (2, 4000))
    away = np.stack([x, np.full_like(x, -2.0), z], axis=1)
    table = intensity_table(45.0, None, gobo.relative_intensity(None))
    actual = intensity(geometry, away / np.linalg.norm(away, axis=1, keepdims=True), table)
    u, v = 0.5 - x / 4, 0.5 - z / 4
    inside = (np.abs(8 * u - np.round(8 * u)) > 0.15) & (np.abs(8 * v - np.round(8 * v)) > 0.15)
    expected = (np.floor(8 * u) + np.floor(8 * v)) % 2 / gobo.mean[0]
    np.testing.assert_allclose(actual[inside], expected[inside], atol=0.02 / gobo.mean[0])
    assert gobo.mean[0] == pytest.approx(0.5, abs=0.02)


def test_a_gobo_is_upright_and_unmirrored_along_the_light(assets):
    """The red quarter is at the upper left, the blue part at the lower right; looking down with +Z up, left is +X."""
    gobo = project_gobo(load_gobo(assets["colored"]), 45.0)
    assert gobo.is_colored
    away = np.array([[x, -2.0, z] for z in (0.5, -0.5) for x in (0.6, -0.6)]) / np.sqrt(4.61)
    geometry = LightGeometry("spot", (0.0, 2.0, 0.0), (0.0, -1.0, 0.0), (44.9, 45.0), gobo=assets["colored"])
    red, blue = (
        intensity(geometry, away, intensity_table(45.0, None, gobo.relative_intensity(k))) * gobo.mean[k]
        for k in (0, 2)
    )
    np.testing.assert_allclose(red[[0, 3]], [1, 0], atol=0.02)
    np.testing.assert_allclose(blue[[0, 3]], [0, 1], atol=0.02)
    turned = geometry._replace(rotation=180.0)
    table = intensity_table(45.0, None, gobo.relative_intensity(2))
    np.testing.assert_allclose(intensity(turned, away, table)[[0, 3]] * gobo.mean[2], [1, 0], atol=0.02)


def test_a_plain_light_has_no_table_and_equal_bits(assets):
    away = directions(500)
    for geometry in (
        LightGeometry("point", POSITION),
        LightGeometry("spot", POSITION, tuple(AXIS), (20.0, 60.0), rotation=40.0),
    ):
        plain = intensity_table(60.0, None, None)
        assert plain.shape == (1, 1)
        twin = np.ones((2, 1), np.float32)
        np.testing.assert_array_equal(intensity(geometry, away, plain), intensity(geometry, away, twin))


def test_shadows_do_not_depend_on_webs_gobos_and_directions(assets):
    web = LightGeometry("point", POSITION, tuple(AXIS), rotation=3.0, profile=assets["skew"])
    spot = LightGeometry("spot", POSITION, tuple(AXIS), (10.0, 20.0), gobo=assets["checker"])
    assert emitter_geometry(web) == emitter_geometry(spot) == LightGeometry("point", POSITION)


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    """A floor and a wall in the dark."""
    materials = [Material("White", ({"model": "lambert", "color": [0.7, 0.7, 0.7]},))]
    ground = quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0)
    wall = quad("wall", [[-2, 0, -2], [2, 0, -2], [2, 2, -2], [-2, 2, -2]], 0)
    camera, dark = make_camera("front", (0.0, 2.2, 4.0), (0, 0.4, -0.5), 0.8), np.full((4, 8, 3), 1e-7, np.float32)
    scene = make_tiny_scene(ground, wall, camera=camera, environment=dark, materials=materials)
    path = tmp_path_factory.mktemp("bake") / "direct.zarr"
    bake_in_process(METHODS["direct"], scene, Recipe("direct", ("front",), (60, 45), 20), path)
    return scene, open_bake(path, Cache(BUDGET))


LIGHTS = {
    "web": {"kind": "point", "profile": "skew", "direction": [0.4, -1, -0.4], "rotation": 30.0},
    "web of one side": {"kind": "point", "profile": "one side", "direction": [0.4, -1, -0.4], "rotation": 30.0},
    "web in a cone": {"kind": "spot", "profile": "skew", "cone": [30, 70], "direction": [0.2, -1, -0.6]},
    "gobo": {"kind": "spot", "gobo": "checker", "cone": [40, 50], "direction": [0.2, -1, -0.6], "rotation": 20.0},
    "colored gobo": {"kind": "spot", "gobo": "colored", "cone": [40, 50], "direction": [0.2, -1, -0.6]},
    "both": {"kind": "spot", "gobo": "colored", "profile": "skew", "cone": [40, 50], "direction": [0.2, -1, -0.6]},
}


def named(light, assets):
    """The light with names of assets in looks."""
    return {field: assets.get(value, value) if isinstance(value, str) else value for field, value in light.items()}


def look_with(transfer, light):
    return validate({"environment": {"intensity": 0.0}, "lights": {"A": light}}, transfer.default_look)


@pytest.mark.parametrize("name", LIGHTS)
def test_images_agree_with_the_reference(bake, assets, name):
    scene, transfer = bake
    light = named(LIGHTS[name], assets) | {"position": [0.0, 1.8, 0.2], "emission": [3.0, 2.0, 4.0]}
    look = look_with(transfer, light)
    rendered = render_image(transfer, "front", look)
    reference = reference_image(scene, "front", look, (60, 45), 16)
    assert np.sqrt(((rendered - reference) ** 2).mean()) < 0.02 * np.sqrt((reference**2).mean())


def test_a_black_gobo_is_dark(bake, assets):
    _, transfer = bake
    light = {"kind": "spot", "gobo": assets["black"], "position": [0.0, 1.8, 0.2]}
    assert render_image(transfer, "front", look_with(transfer, light)).max() < 1e-5


@pytest.mark.parametrize(
    ("light", "pointer"),
    [
        ({"kind": "point", "profile": "ies:0000000000000000"}, "/lights/A/profile"),
        ({"kind": "point", "profile": 3}, "/lights/A/profile"),
        ({"kind": "point", "profile": "../ies"}, "/lights/A/profile"),
        ({"kind": "point", "gobo": "checker"}, "/lights/A/gobo"),
        ({"kind": "spot", "gobo": "image:0000000000000000"}, "/lights/A/gobo"),
        ({"kind": "spot", "gobo": "skew"}, "/lights/A/gobo"),
        ({"kind": "spot", "gobo": "checker", "cone": [20, 89]}, "/lights/A/cone/1"),
    ],
)
def test_invalid_profiles_and_gobos_are_rejected(bake, assets, light, pointer):
    with pytest.raises(ParameterError) as error:
        look_with(bake[1], named(light, assets))
    assert error.value.name == pointer
