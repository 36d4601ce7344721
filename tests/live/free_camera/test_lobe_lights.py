"""Area lights in narrow lobes while a camera moves: sampled lobes, and exact views."""

import numpy as np
import pytest
from scipy.ndimage import median_filter
from tiny_scenes import make_camera, quad

from relume.brdf.lobe_sampling import lobe_of
from relume.core.cache import Cache
from relume.lights.local_lights import make_light_strata, prepare_local_lights
from relume.lights.shape_triangles import LightTriangles
from relume.live.free_camera import lobe_coverage
from relume.live.free_camera.lobe_lights import LobeEmitter
from relume.live.opened.openers import open_bake
from relume.live.opened.static_view import StaticViewBuilder
from relume.look import LightGeometry, complete, validate
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.raytrace.lobe_directions import make_lobe_pattern
from relume.scene.model import Environment, Light, Material
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

GGX = {"model": "ggx", "color": [1.0] * 3, "params": {"roughness": 0.15, "f0": 0.9}}
PHONG = {"model": "phong", "color": [1.0] * 3, "params": {"exponent": 900.0}}
CAMERA = make_camera("front", [0, 1.0, 2.4], [0, 0.2, 0], 0.8)
SIZE = (96, 72)
EMISSION = 6.0


def sampled_coverage(pattern, corners, wo, rng, num=400_000):
    """Share of directions, drawn from the lobe of one point, that meet a triangle."""
    u, azimuth = rng.random(num), 2 * np.pi * rng.random(num)
    fraction = np.linspace(0, 1, pattern.quantile.shape[1])
    angle = np.interp(u, fraction, pattern.quantile[0].astype(np.float64))
    axis = np.stack([np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), np.cos(angle)], axis=1)
    if pattern.is_half_angle:
        wi = 2 * (axis @ wo)[:, None] * axis - wo
    else:
        mirrored = np.array([-wo[0], -wo[1], wo[2]])
        t = np.cross([0, 1, 0], mirrored)
        t /= np.linalg.norm(t)
        wi = axis @ np.stack([t, np.cross(mirrored, t), mirrored])
    barycentric = np.linalg.solve(np.transpose(corners), wi.T)
    return np.mean((barycentric > 0).all(axis=0))


@pytest.mark.parametrize("document", [GGX, PHONG], ids=["half angle", "mirror angle"])
def test_the_share_of_a_lobe_that_a_triangle_covers(document):
    rng = np.random.default_rng(5)
    pattern, shares = make_lobe_pattern(lobe_of(document), 4, 1), []
    for _ in range(40):
        theta = rng.uniform(0.1, 0.9)
        wo = np.array([np.sin(theta), 0, np.cos(theta)])
        mirrored = np.array([-wo[0], 0, wo[2]])
        corners = 2 * mirrored + rng.normal(0, rng.choice([0.03, 0.1, 0.5]), (3, 3))
        local = tuple(tuple(np.float32(x) for x in corner) for corner in corners)
        coverage = lobe_coverage.lobe_coverage(pattern, local, tuple(np.float32(x) for x in wo))
        expected = sampled_coverage(pattern, corners, wo, rng)
        assert abs(coverage - expected) < 0.02
        shares.append(expected)
    assert min(shares) < 0.05
    assert max(shares) > 0.8


def rectangle(size=(0.4, 0.2)):
    return LightGeometry("rectangle", position=(0.0, 1.0, 0.0), direction=(0.0, -1.0, 0.0), size=size)


def test_triangles_of_lights():
    light = prepare_local_lights(rectangle())
    emitter = LobeEmitter.from_light(light, make_light_strata(light, 16))
    edges = emitter.triangles[:, 1:] - emitter.triangles[:, :1]
    np.testing.assert_allclose(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2, 0.04, rtol=1e-5)
    np.testing.assert_allclose(emitter.radiance, 1, rtol=1e-5)
    np.testing.assert_allclose(emitter.normal, [[0, -1, 0]] * 2, atol=1e-6)
    np.testing.assert_allclose(emitter.radius, np.hypot(0.2, 0.1), rtol=0.1)
    # a mesh of many triangles keeps its power
    corners = np.random.default_rng(2).normal(0, 1, (300, 3, 3)).astype(np.float32)
    mesh = prepare_local_lights(
        LightGeometry("mesh", material="Lamp"), LightTriangles(corners, np.ones(300, np.float32), is_two_sided=True)
    )
    emitter = LobeEmitter.from_light(mesh, make_light_strata(mesh, 16))
    edges = emitter.triangles[:, 1:] - emitter.triangles[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2
    assert len(area) <= 128
    np.testing.assert_allclose((area * emitter.radiance).sum(), mesh.area, rtol=1e-4)
    point = prepare_local_lights(LightGeometry("point", position=(0.0, 1.0, 0.0)))
    assert not len(LobeEmitter.from_light(point, make_light_strata(point, 16)).triangles)


@pytest.fixture(scope="module")
def lamplit(tmp_path_factory):
    floor = quad("floor", [[-1.5, 0, 1.5], [1.5, 0, 1.5], [1.5, 0, -1.5], [-1.5, 0, -1.5]], 0)
    plate = quad("plate", [[-0.3, 1.2, -1.2], [0.3, 1.2, -1.2], [0.3, 1.2, -0.8], [-0.3, 1.2, -0.8]], 1)
    white = {"model": "lambert", "color": [0.8] * 3}
    polished = {**GGX, "params": {"roughness": 0.05, "f0": 0.9}}
    materials = [Material("Floor", (polished,)), Material("Lamp", (white,), double_sided=False)]
    light = Light("Lamp", {"kind": "mesh", "material": "Lamp", "emission": [EMISSION] * 3})
    environment = Environment("night", np.full((4, 8, 3), 0.02, np.float32))
    scene = make_scene("lamplit", [floor, plate], materials, [CAMERA], environment, lights=[light])
    recipe = Recipe("probes", ("front",), SIZE, 100, num_probes=3000)
    path = bake_in_process(METHODS["probes"], scene, recipe, tmp_path_factory.mktemp("lamp") / "s.zarr")
    bake = open_bake(path, Cache(1 << 30))
    return bake, StaticViewBuilder(bake.light_transport, scene)


def test_the_reflection_of_an_area_light_is_that_of_the_exact_view_without_speckle(lamplit):
    bake, builder = lamplit
    look = validate(complete({}, bake.default_look), bake.default_look)
    moving = render_image(bake, "front", look)[..., :3]
    exact = render_image(bake, "front", look, static_views=builder)[..., :3]
    # the mirror image of the light, without the light itself
    is_floor = (np.arange(SIZE[1]) > 0.45 * SIZE[1])[:, None] & (exact.max(axis=2) > 0)
    is_lit = is_floor & (exact.max(axis=2) > 1)
    assert is_lit.sum() > 50
    assert abs(moving[is_lit].mean() / exact[is_lit].mean() - 1) < 0.03
    error = np.sqrt(np.mean((moving - exact)[is_floor] ** 2) / np.mean(exact[is_floor] ** 2))
    assert error < 0.1
    speckle = np.abs(moving - median_filter(moving, size=(3, 3, 1)))[is_floor]
    assert np.percentile(speckle, 99) < 0.005 * EMISSION
