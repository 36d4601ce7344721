"""Hard-shadow lights: sun disks and small lights with per-pixel shadows, against all shadow rays and fixed views."""

import copy

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere

from relume.assets.environments.equirect import texel_directions
from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import illumination_from_look
from relume.live.free_camera.adaptive_shadows import visible_fractions
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.incident_light import combine_all
from relume.live.opened.openers import open_bake
from relume.look import complete, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.raytrace.ray_origins import ray_origins
from relume.raytrace.visibility import trace_visibility
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

CAMERA = make_camera("front", [0.5, 2.2, 2.6], [0, 0.2, 0], 0.7)
SIZE = (96, 72)
SUN = np.array([0.5, 1.0, 0.25]) / np.linalg.norm([0.5, 1.0, 0.25])
FLOOR = quad("floor", [[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3]], 0)
LAMBERT = {"model": "lambert", "color": [0.8, 0.7, 0.6]}
GLOSSY = {"model": "blinn_phong", "color": [0.2, 0.2, 0.2], "params": {"exponent": 8.0}}
LIGHTS = {
    "point": {"kind": "point", "position": [0.8, 1.9, 0.4], "emission": [9.0, 8.0, 6.0]},
    "spot": {
        "kind": "spot", "position": [0.8, 1.9, 0.4], "direction": [-0.5, -1.0, -0.2], "emission": [9.0, 8.0, 6.0],
        "cone": [20.0, 40.0],
    },
    "directional": {"kind": "directional", "direction": [-0.5, -1.0, -0.25], "emission": [3.0, 2.8, 2.5]},
}  # fmt: skip


def environment_with_sun(turn=0.0):
    towards = texel_directions(128, 256).astype(np.float64)
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    sun = SUN @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    radiance = np.where(towards[..., 1:2] > 0, 0.3, 0.0) * [0.6, 0.8, 1.0]
    radiance[towards @ sun > np.cos(np.radians(1.0))] += [5e3, 4.6e3, 4e3]
    return radiance.astype(np.float32)


def scene(environment, terms=(LAMBERT,)):
    ball, wall = (
        sphere("ball", [0.1, 0.4, 0], 0.4, 1, 16),
        quad("wall", [[-1, 0, 0], [-1, 0, -1], [-1, 1, -1], [-1, 1, 0]], 1),
    )
    materials = [Material("Floor", terms), Material("Things", (LAMBERT,))]
    return make_tiny_scene(FLOOR, ball, wall, camera=CAMERA, environment=environment, materials=materials)


def opened(scene_to_bake, method, folder, num_points=2000):
    recipe = Recipe(method, ("front",), SIZE, 200, num_probes=num_points)
    return open_bake(bake_in_process(METHODS[method], scene_to_bake, recipe, folder / f"{method}.zarr"), Cache(1 << 30))


def look_of(bake, change=lambda document: None):
    document = copy.deepcopy(complete({}, bake.default_look))
    document["transport"]["show"] = "direct"
    change(document)
    return validate(document, bake.default_look)


def picture_of(bake, look, *, draws=True):
    picture = FreeCameraPicture(bake, "front")
    picture.set_look(look)
    picture.renders_pixels = draws
    picture.advance(None)
    return picture


def error(actual, expected):
    """Root mean square error relative to the expected values."""
    return np.sqrt(np.mean((actual - expected) ** 2) / np.mean(expected**2))


@pytest.fixture(scope="module")
def sunlit(tmp_path_factory):
    return opened(scene(environment_with_sun()), "probes", tmp_path_factory.mktemp("beams"))


@pytest.fixture(scope="module")
def fixed(tmp_path_factory):
    return opened(scene(environment_with_sun()), "direct", tmp_path_factory.mktemp("fixed"))


def test_visible_fractions_equal_those_of_all_shadow_rays(sunlit):
    """The prediction agrees wherever all targets of a pixel and its neighbors agree."""
    picture = picture_of(sunlit, look_of(sunlit))
    picture.image()
    gbuffer, solid = picture._current_gbuffer(), sunlit.occlusion_mesh
    (hard_light,) = sunlit.hard_shadow_lights(picture._current_light(), None)
    fractions = visible_fractions(solid, gbuffer, CAMERA, SIZE, hard_light.targets)
    face = gbuffer.hits.face
    normal = solid.stored_scene.face_normal[face] * -np.sign(
        np.einsum("nc,nc->n", solid.stored_scene.face_normal[face], gbuffer.directions)
    )[:, None].astype(np.float32)
    hits = np.flatnonzero(face >= 0)
    is_inner = np.einsum("nc,nc->n", normal, solid.stored_scene.face_normal[face])[hits] < 0
    origins = ray_origins(solid.origins, face[hits], gbuffer.hits.uv[hits], is_inner).position
    towards = np.ascontiguousarray(hard_light.targets.towards.reshape(-1, 3))
    bits = trace_visibility(sunlit.embree, origins, np.ascontiguousarray(normal[hits]), towards).visible
    expected = np.zeros(len(face))
    expected[hits] = np.unpackbits(bits, axis=1, count=len(towards), bitorder="little").mean(axis=1)
    width, height = SIZE
    of_pixels, around = expected[: width * height].reshape(height, width), []
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            around.append(np.roll(of_pixels, (dy, dx), axis=(0, 1)))
    is_even = (np.ptp(around, axis=0) == 0) & (np.arange(width) % (width - 1) > 0)
    difference = np.abs(fractions[: width * height].reshape(height, width) - of_pixels)
    assert 0.1 < of_pixels.mean() < 0.9
    assert is_even.mean() > 0.8
    assert (difference[is_even] > 0).mean() < 1e-3
    assert difference[~is_even].mean() < 0.15
    across = slice(width * height, None)
    assert np.abs(fractions[across] - expected[across]).mean() < 0.1


@pytest.mark.parametrize("terms", [(LAMBERT,), (LAMBERT, GLOSSY)], ids=["diffuse", "glossy"])
def test_a_hard_sun_casts_the_shadows_of_a_fixed_view(terms, tmp_path):
    sunlit_scene = scene(environment_with_sun(), terms)
    fixed, bake = (opened(sunlit_scene, method, tmp_path) for method in ("direct", "probes"))
    expected = render_image(fixed, "front", look_of(fixed))
    by_pixels = error(picture_of(bake, look_of(bake)).image(), expected)
    by_points = error(picture_of(bake, look_of(bake), draws=False).image(), expected)
    assert by_pixels < 0.1
    assert by_points > 1.5 * by_pixels


def test_a_rotated_sun_casts_rotated_shadows(sunlit, tmp_path):
    """Shadows equal those of a bake of the rotated environment; the bake's own lights lie around the original sun."""
    rotated = scene(environment_with_sun(70.0))
    baked = opened(rotated, "direct", tmp_path)
    expected = render_image(baked, "front", look_of(baked))
    look = look_of(sunlit, lambda document: document["environment"].update(rotation=70.0))
    by_pixels = error(picture_of(sunlit, look).image(), expected)
    assert by_pixels < 0.12
    assert error(picture_of(sunlit, look, draws=False).image(), expected) > 2 * by_pixels


@pytest.mark.parametrize("kind", LIGHTS)
def test_small_lights_cast_the_shadows_of_a_fixed_view(kind, sunlit, fixed):
    def lit(document):
        document["lights"] = {"Lamp": copy.deepcopy(LIGHTS[kind])}
        document["environment"]["intensity"] = 0.0

    expected = render_image(fixed, "front", look_of(fixed, lit))
    by_pixels = error(picture_of(sunlit, look_of(sunlit, lit)).image(), expected)
    assert by_pixels < 0.1
    assert error(picture_of(sunlit, look_of(sunlit, lit), draws=False).image(), expected) > 1.5 * by_pixels


def test_hard_shadow_lights_and_probe_light_sum_to_the_whole(sunlit):
    """Without occlusion of the sun, a shader gets the interpolated light plus the hard-shadow light."""
    light = illumination_from_look(look_of(sunlit), sunlit.material_names, has_bounces=True)
    whole, apart = combine_all(sunlit, light), combine_all(sunlit, light, has_hard_shadows=True)
    (hard_light,) = apart.hard_shadow_lights
    assert not whole.hard_shadow_lights
    together = apart.total[:, :, 0] + hard_light.gain * hard_light.vectors[:, :, 0]
    is_lit = whole.total[:, 0, 0] > 0.9 * together[:, 0]
    assert 0.2 < is_lit.mean() < 0.9
    difference = np.abs(whole.total[is_lit][:, :, 0] / together[is_lit] - 1).max(axis=1)
    assert np.quantile(difference, 0.99) < 0.02  # some lie in a penumbra
    assert (apart.total[:, 0, 0] < 0.3 * together[is_lit, 0].max()).all()
