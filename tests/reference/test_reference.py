"""The reference against closed forms, plain NumPy, its own statistics, and rendered frames."""

from pathlib import Path

import numpy as np
import pytest
from analytic_terms import ANALYTIC
from session_edits import relative_rmse
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere, still_life, studio

from relume.assets.environments.environment import Environment
from relume.assets.environments.equirect import texel_directions, texel_solid_angles, uv_to_direction
from relume.brdf.evaluate import eval_brdf
from relume.core.cache import Cache
from relume.core.errors import CancelledError, PlanError
from relume.live.fixed_camera.protocols import FixedViewTransfer
from relume.live.opened.openers import open_transfer
from relume.look import default_look, validate
from relume.methods.direct import DirectMethod
from relume.output.render_image import render_image
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.reference import (
    ReferenceImage,
    ReferencePoints,
    environment_texels,
    reference_image,
    reference_radiance,
    render_reference,
)
from relume.scene.model import Light, Material, Scene
from relume.scene.scene_folder import make_scene
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

WHITE = {"model": "lambert", "color": [1.0, 1.0, 1.0], "params": {}, "curves": {}, "texture": None}


def image_of(scene, size, spp, *, reflects=False, **changes):
    default = default_look(scene.materials)
    return reference_image(scene, scene.cameras[0].name, validate(changes, default), size, spp, reflects=reflects)


def test_a_white_ball_in_a_white_furnace_vanishes() -> None:
    ball = sphere("ball", [0, 0, 0], 1.0, 0, num_rings=24)
    scene = make_tiny_scene(
        ball, camera=make_camera("front", [0, 0, 4], [0, 0, 0], 0.6), environment=np.ones((64, 128, 3), "f")
    )
    # a facet occludes directions between its plane and the horizon of the smooth normal
    np.testing.assert_allclose(image_of(scene, (32, 32), 0), 1.0, rtol=0.01)


def test_a_floor_under_one_texel_equals_the_closed_form() -> None:
    """R = L ΔΩ · albedo/π · cos θi, with the shadow of a wall in front of the texel."""
    radiance = np.zeros((16, 32, 3), np.float32)
    radiance[4, 16] = [300.0, 200.0, 100.0]
    wi = texel_directions(16, 32)[4, 16].astype(float)
    wall = quad("wall", [[0.5, 0, 1], [0.5, 0, -1], [0.5, 1, -1], [0.5, 1, 1]], 0)
    floor = quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0)
    scene = make_tiny_scene(
        floor, wall, camera=make_camera("front", [0, 4, 0.01], [0, 0, 0], 0.1), environment=radiance
    )
    points = ReferencePoints(
        position=np.array([[0.4, 1e-4, 0], [1.0, 1e-4, 0]], np.float32),
        normal=np.array([[0, 1, 0]] * 2, np.float32),
        tangent=np.array([[1, 0, 0]] * 2, np.float32),
        wo=np.array([[0, 1, 0]] * 2, np.float32),
        textures={},
        roughness=np.ones(2, np.float32),
    )
    outgoing = reference_radiance(build_scene_buffers(scene), environment_texels(scene.environment), points, [[WHITE]])[
        0
    ]
    expected = radiance[4, 16] * texel_solid_angles(16, 32)[4] / np.pi * wi[1]
    assert wi[:2].min() > 0.5
    np.testing.assert_allclose(outgoing, [np.zeros(3), expected], rtol=1e-6)


DRAWN = {"theta_h": [{"points": [[0, 9.0], [20, 2.0], [90, 0.1]], "channels": "rg"}, {"bands": [0.5, 2.0] * 128}]}


HALF_ANGLE = [name for name, term in ANALYTIC.items() if "theta_h" in {curve.name for curve in term.curves}]


@pytest.mark.parametrize(
    ("model", "curves"), [*((name, {}) for name in ANALYTIC), *((name, DRAWN) for name in HALF_ANGLE)]
)
def test_terms_equal_the_plain_brdf(model: str, curves: dict[str, object]) -> None:
    rng = np.random.default_rng(3)
    scene = make_tiny_scene(
        quad("far", [[90, 0, 1], [91, 0, 1], [91, 0, 0], [90, 0, 0]], 0),
        camera=make_camera("front", [0, 1, 0], [0, 0, 0.1], 0.1),
        environment=rng.random((24, 48, 3), np.float32),
    )
    document = {"model": model, "color": [0.9, 0.5, 0.2], "params": {}, "curves": curves, "texture": "diffuse"}
    wo = np.array([0.4, 0.8, 0.2]) / np.linalg.norm([0.4, 0.8, 0.2])
    points = ReferencePoints(
        np.array([[0, 0.1, 0]], np.float32), np.array([[0, 1, 0]], np.float32), np.array([[0, 0, 1]], np.float32),
        wo[None].astype(np.float32), {"diffuse": np.array([[1.0, 0.5, 0.25]], np.float32)},
        np.ones(1, np.float32),
    )  # fmt: skip
    radiance = reference_radiance(
        build_scene_buffers(scene), environment_texels(scene.environment), points, [[document]]
    )[0, 0]
    frame = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]], float)  # rows: tangent, n × t, normal
    u, v = np.meshgrid((np.arange(48) + 0.5) / 48, (np.arange(24) + 0.5) / 24)
    wi = uv_to_direction(u, v) @ frame.T
    light = scene.environment.radiance * texel_solid_angles(24, 48)[:, None, None]
    value = eval_brdf(document, wi, frame @ wo) * np.maximum(wi[..., 2:], 0)
    np.testing.assert_allclose(radiance, (value * light).sum(axis=(0, 1)) * [1.0, 0.5, 0.25], rtol=1e-4)


def corner_of(albedo):
    """A floor and a wall in an environment of radiance one."""
    parts = [
        quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0),
        quad("wall", [[-1, 0, -1], [1, 0, -1], [1, 2, -1], [-1, 2, -1]], 0),
    ]
    material = Material("Plaster", ({"model": "lambert", "color": [albedo] * 3},))
    camera = make_camera("front", [0, 0.7, 2.4], [0, 0.5, -0.5], 0.5)
    return make_tiny_scene(*parts, camera=camera, environment=np.ones((64, 128, 3), "f"), materials=(material,))


@pytest.mark.slow
def test_white_corner_in_a_white_furnace_vanishes() -> None:
    """The reflected light of the wall replaces the environment light that it occludes."""
    image = image_of(corner_of(1.0), (16, 16), 2048, reflects=True)  # noise of the mean: 0.4 %
    assert image.mean() == pytest.approx(1.0, rel=0.01)
    assert image_of(corner_of(1.0), (16, 16), 512).mean() < 0.9


def test_light_paths_of_a_gray_corner_add_up() -> None:
    """Including Russian roulette: the same paths, separated by length."""
    shown = {
        show: image_of(corner_of(0.5), (16, 16), 64, reflects=True, transport={"show": show})
        for show in ("all", "direct", "first_bounce", "further_bounces")
    }
    parts = shown["direct"] + shown["first_bounce"] + shown["further_bounces"]
    np.testing.assert_allclose(parts, shown["all"], rtol=1e-5)
    assert 0.02 < shown["further_bounces"].mean() / shown["first_bounce"].mean() < 0.4


def test_the_omitted_light_is_the_difference_of_the_references() -> None:
    scene, size = corner_of(0.5), (16, 16)

    def reference_of(reflects: bool, **transport: object) -> ReferenceImage:
        look = validate({"transport": transport}, default_look(scene.materials))
        return render_reference(scene, "front", look, size, 64, reflects=reflects)

    shown = {show: image_of(scene, size, 64, reflects=True, transport={"show": show}) for show in ("all", "direct")}
    direct = reference_of(False)
    np.testing.assert_allclose(direct.all_paths_image, shown["all"], rtol=1e-5)  # light after 24 bounces is negligible
    np.testing.assert_allclose(direct.method_image, shown["direct"], rtol=1e-6)
    assert "Indirect light" in direct.omitted_paths[0]
    few = reference_of(True, bounces=1)
    np.testing.assert_allclose(few.all_paths_image, shown["all"], rtol=1e-5)
    assert shown["direct"].mean() < few.method_image.mean() < few.all_paths_image.mean()
    assert few.omitted_paths == ("Light after more than 1 bounces.",)
    direct_only = reference_of(False, show="direct")  # no displayed light is omitted
    np.testing.assert_array_equal(direct_only.all_paths_image, direct_only.method_image)
    assert direct_only.omitted_paths == direct_only.unsupported_paths == ()


def test_mirrored_direct_light_is_direct_light(tmp_path: Path) -> None:
    """A chrome wall before a colored floor: frames of `direct` show the floor in it, and so does the reference."""
    chrome = {"model": "ggx", "color": [1, 1, 1], "params": {"roughness": 0.03, "f0": 0.9}}
    materials = (
        Material("Floor", ({"model": "lambert", "color": [0.8, 0.4, 0.1]},)),
        Material("Chrome", (chrome,)),
    )
    parts = [
        quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0),
        quad("wall", [[-1, 0, -1], [1, 0, -1], [1, 1, -1], [-1, 1, -1]], 1),
    ]
    camera = make_camera("front", [0, 0.6, 1.2], [0, 0.35, -1], 0.3)
    scene = make_tiny_scene(*parts, camera=camera, environment=np.ones((64, 128, 3), "f"), materials=materials)
    look, size = validate({}, default_look(scene.materials)), (24, 18)
    store = bake_in_process(DirectMethod(), scene, Recipe("direct", ("front",), size, 500), tmp_path / "store.zarr")
    frame = render_image(open_transfer(store, Cache(1 << 30)), "front", look)
    followed = reference_image(scene, "front", look, size, 1024)
    in_mirror = followed[12:].mean(axis=(0, 1))
    assert in_mirror[0] == pytest.approx(8 * in_mirror[2], rel=0.01)
    np.testing.assert_allclose(frame[12:].mean(axis=(0, 1)), in_mirror, rtol=0.03)
    assert relative_rmse(frame[:10], followed[:10]) < 0.02


def test_sampled_texels_are_unbiased() -> None:
    """The mean over packets with separate random numbers lies within four standard errors, and the error falls."""
    scene = still_life()
    geometry, texels = build_scene_buffers(scene), environment_texels(scene.environment)
    count = 16 * 64  # one point repeatedly: packets differ by random numbers only
    repeat = lambda row: np.repeat(np.array([row], np.float32), count, axis=0)  # noqa: E731
    frame = repeat([0, 1, 0]), repeat([1, 0, 0]), repeat([0, 0.6, 0.8])
    points = ReferencePoints(repeat([0.6, 1e-3, 0.4]), *frame, {}, repeat([1.0])[:, 0])
    terms = [WHITE, {**WHITE, "model": "cook_torrance", "params": {"sigma": 0.3}}]
    expected = reference_radiance(geometry, texels, points.samples_of(slice(0, 1)), [terms])[0, 0]
    spread = []
    for spp in (32, 256):
        means = reference_radiance(geometry, texels, points, [terms], spp)[0, ::16]
        error = means.std(axis=0, ddof=1) / np.sqrt(len(means))
        assert np.all(error > 0)
        np.testing.assert_array_less(np.abs(means.mean(axis=0) - expected), 4 * error)
        spread.append(means.std(axis=0).mean())
    assert spread[1] < spread[0] / 2


def test_the_same_seed_gives_the_same_image() -> None:
    scene = still_life()
    np.testing.assert_array_equal(image_of(scene, (24, 18), 40), image_of(scene, (24, 18), 40))


def test_as_many_samples_as_texels_use_all_texels() -> None:
    scene = still_life()
    np.testing.assert_array_equal(image_of(scene, (24, 18), 0), image_of(scene, (24, 18), 1 << 20))


def test_a_rendered_frame_equals_the_reference(tmp_path: Path) -> None:
    scene, size = still_life(), (48, 36)
    store = bake_in_process(DirectMethod(), scene, Recipe("direct", ("front",), size, 4000), tmp_path / "store.zarr")
    default = default_look(scene.materials)
    partial = {"environment": {"intensity": 0.5}, "materials": {"Ball": {"terms": [WHITE]}}}
    frame = render_image(open_transfer(store, Cache(1 << 30)), "front", validate(partial, default))
    expected = image_of(scene, size, 0, **partial)
    assert relative_rmse(frame, expected) < 0.005
    assert frame.mean() == pytest.approx(expected.mean(), rel=0.002)


def test_a_rotation_equals_a_shifted_map() -> None:
    """A rotation by one column shifts the map by one: u decreases with the rotation."""
    radiance = studio(16)
    camera = make_camera("front", [0.3, 1.1, 3], [0, 0.45, 0], 0.8)
    ball = sphere("ball", [0, 0.5, 0], 0.5, 0, num_rings=10)
    rotated = image_of(
        make_tiny_scene(ball, camera=camera, environment=radiance), (32, 24), 0, environment={"rotation": 90.0}
    )
    shifted = make_tiny_scene(ball, camera=camera, environment=np.roll(radiance, -8, axis=1))
    np.testing.assert_allclose(rotated, image_of(shifted, (32, 24), 0), rtol=2e-3, atol=1e-4)


def test_the_reference_reports_progress_and_can_be_cancelled() -> None:
    scene = still_life()
    look = validate({}, default_look(scene.materials))
    fractions: list[float] = []
    reference_image(scene, "front", look, (24, 18), 10, fractions.append)
    assert fractions == sorted(fractions)
    assert fractions[-1] == pytest.approx(1.0)
    with pytest.raises(CancelledError):
        reference_image(scene, "front", look, (24, 18), 10, is_canceled=lambda: True)


def test_the_reference_rejects_what_a_bake_rejects() -> None:
    scene = still_life()
    look = validate({}, default_look(scene.materials))
    with pytest.raises(PlanError, match="no view"):
        reference_image(scene, "nowhere", look, (24, 18), 10)
    with pytest.raises(PlanError, match="pixels"):
        reference_image(scene, "front", look, (100_000, 100_000), 10)


def test_black_texels_are_omitted() -> None:
    radiance = np.zeros((8, 16, 3), np.float32)
    radiance[2, 3] = [0, 0, 1]
    assert environment_texels(Environment("one", radiance)).num_texels == 1


LIGHTS: dict[str, dict[str, object]] = {
    "point": {"kind": "point", "position": [0.9, 1.4, 1.2], "emission": [3.0, 2.0, 1.0]},
    "spot": {"kind": "spot", "position": [0.2, 1.9, 1.3], "direction": [0, -1, -0.7], "emission": [9.0, 5.0, 5.0]},
    "directional": {"kind": "directional", "direction": [-1, -2, -1], "emission": [2.0, 2.0, 2.0]},
    "sun": {"kind": "directional", "direction": [-1, -2, -1], "angle": 8.0, "emission": [2.0, 2.0, 2.0]},
    "disc": {
        "kind": "disc", "position": [-1.0, 1.5, 1.0], "direction": [1, -1, -1], "radius": 0.3, "emission": [9.0] * 3,
    },
    "sphere": {"kind": "sphere", "position": [0.9, 1.4, 1.2], "radius": 0.15, "emission": [30.0, 20.0, 10.0]},
    "tube": {
        "kind": "tube", "position": [0.2, 1.7, 1.3], "direction": [1, 0.2, 0], "radius": 0.04, "length": 1.2,
        "emission": [40.0, 40.0, 40.0],
    },
    "rectangle": {
        "kind": "rectangle", "position": [-1.0, 1.5, 1.0], "direction": [1, -1, -1], "rotation": 25.0,
        "size": [0.9, 0.4], "emission": [5.0, 5.0, 5.0],
    },
    "mesh": {"kind": "mesh", "material": "Wall", "emission": [1.0, 0.7, 0.4]},
}  # fmt: skip


@pytest.fixture(scope="module")
def lit_bake(tmp_path_factory: pytest.TempPathFactory) -> tuple[Scene, FixedViewTransfer]:
    """The still life with an emissive wall."""
    parts = still_life()
    wall = Light("mesh", LIGHTS["mesh"])
    scene = make_scene("lit", parts.meshes, parts.materials, parts.cameras, parts.environment, lights=[wall])
    folder = tmp_path_factory.mktemp("lit")
    store = bake_in_process(DirectMethod(), scene, Recipe("direct", ("front",), (48, 36), 500), folder / "store.zarr")
    return scene, open_transfer(store, Cache(1 << 30))


@pytest.mark.parametrize("kind", LIGHTS)
def test_frames_under_each_kind_of_local_light_equal_the_reference(
    lit_bake: tuple[Scene, FixedViewTransfer], kind: str
) -> None:
    scene, transfer = lit_bake
    lights = {"mesh": {"enabled": kind == "mesh"}, **({} if kind == "mesh" else {kind: LIGHTS[kind]})}
    look = validate({"environment": {"intensity": 0.0}, "lights": lights}, transfer.default_look)
    frame = render_image(transfer, "front", look)
    expected = reference_image(scene, "front", look, (48, 36), 1 if kind in ("point", "spot", "directional") else 1024)
    assert expected.mean() > 0.01
    assert frame.mean() == pytest.approx(expected.mean(), rel=0.01)
    # curves in bands and few samples; the wall touches the floor, with few samples near it
    assert relative_rmse(frame, expected) < {"rectangle": 0.03, "mesh": 0.07}.get(kind, 0.02)
