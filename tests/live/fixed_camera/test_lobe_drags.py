"""Dragging the width of a polished surface with indirect light: it follows in each frame, and nothing else changes."""

import numpy as np
import pytest
from scipy.ndimage import binary_erosion
from session_edits import BUDGET, make_look, run_until_exact
from tiny_scenes import make_camera, make_tiny_scene, quad, sphere

from relume.core.cache import Cache
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.strategies.earlier_reflectances import EARLIER_REFLECTANCES
from relume.live.opened.openers import open_transfer
from relume.methods.registry import METHODS
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

CAMERA = make_camera("front", [0.4, 1.2, 3.2], [0, 0.45, 0], 0.7)
METAL = {"model": "ggx", "color": [1.0] * 3, "params": {"roughness": 0.4, "f0": 0.9}}
ROUGHNESS, F0 = (f"/materials/Ball/terms/0/params/{name}" for name in ("roughness", "f0"))


@pytest.fixture(scope="module")
def polished(tmp_path_factory):
    environment = np.full((16, 32, 3), 0.5, np.float32)
    environment[4:6, 8:12] = 8
    ball = sphere("ball", (0, 0.5, 0), 0.5, 0, num_rings=24)
    floor = quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 1)
    materials = [Material("Ball", (METAL,)), Material("Floor", ({"model": "lambert", "color": [0.8, 0.1, 0.1]},))]
    scene = make_tiny_scene(ball, floor, camera=CAMERA, environment=environment, materials=materials)
    recipe = Recipe("gather", ("front",), (96, 72), 200)
    path = bake_in_process(METHODS["gather"], scene, recipe, tmp_path_factory.mktemp("polished") / "s.zarr")
    return open_transfer(path, Cache(1 << 30))


def set_metal(document, roughness, f0=0.9):
    document["materials"]["Ball"]["terms"] = [{**METAL, "params": {"roughness": roughness, "f0": f0}}]


def rough(transfer, roughness):
    return make_look(transfer, lambda document: set_metal(document, roughness))


@pytest.fixture
def prepared(polished):
    picture = Picture(polished, "front", Cache(BUDGET), is_watched=True)
    picture.set_look(rough(polished, 0.4))
    run_until_exact(picture)
    picture.prepare(ROUGHNESS)
    return run_until_exact(picture)


def exact(transfer, roughness):
    picture = Picture(transfer, "front", Cache(BUDGET))
    picture.set_look(rough(transfer, roughness))
    return run_until_exact(picture).image()


def masks(transfer):
    """Pixels of the ball, and of the floor away from edges."""
    ids = transfer.views["front"].material_ids()
    return ids == 0, binary_erosion(ids == 1, iterations=2)


@pytest.mark.parametrize("roughness", [0.3, 0.1, 0.05])
def test_a_dragged_width_is_followed_in_the_frame(polished, prepared, roughness):
    before, (ball, floor) = prepared.image(), masks(polished)
    prepared.set_look(rough(polished, roughness), active_pointer=ROUGHNESS)
    progress = prepared.advance(None)
    assert progress.fidelity == Fidelity.APPROXIMATE
    shown, expected = prepared.image(), exact(polished, roughness)
    np.testing.assert_array_equal(shown[floor], before[floor])
    error, was = (
        np.linalg.norm((image - expected)[ball]) / np.linalg.norm(expected[ball]) for image in (shown, before)
    )
    assert error < 0.5 * was
    assert abs(shown[ball].mean() / expected[ball].mean() - 1) < 0.05


def test_a_drag_to_and_fro_ends_exact(polished, prepared):
    for roughness in (0.2, 0.05, 0.3, 0.05):
        prepared.set_look(rough(polished, roughness), active_pointer=ROUGHNESS)
        prepared.advance(None)
    assert prepared.next_job().key[0] == "some lobe rays"
    run_until_exact(prepared)
    np.testing.assert_allclose(prepared.image(), exact(polished, 0.05), rtol=1e-4, atol=1e-4)


def test_every_step_of_a_slow_drag_is_shown(polished, prepared):
    images = []
    for roughness in (0.1, 0.1001, 0.1002):  # quantized reflectances are equal
        prepared.set_look(rough(polished, roughness), active_pointer=ROUGHNESS)
        prepared.advance(None)
        images.append(prepared.image())
    assert (images[0] != images[1]).any()
    assert (images[1] != images[2]).any()


def test_only_the_dragged_material_is_drawn_again(polished, prepared):
    before, (ball, floor) = prepared.image(), masks(polished)
    for roughness in (0.3, 0.2):
        prepared.set_look(rough(polished, roughness), active_pointer=ROUGHNESS)
        tiles = prepared.advance(None).tiles
    is_drawn = np.zeros_like(ball)
    for x, y, width, height in tiles:
        is_drawn[y : y + height, x : x + width] = True
    assert is_drawn[ball].all()
    assert is_drawn.mean() < 0.75
    np.testing.assert_array_equal(prepared.image()[floor], before[floor])
    np.testing.assert_allclose(run_until_exact(prepared).image(), exact(polished, 0.2), rtol=1e-4, atol=1e-4)


def test_a_dragged_reflectance_is_free_of_noise(polished):
    picture = Picture(polished, "front", Cache(BUDGET), is_watched=True)
    picture.set_look(rough(polished, 0.1))
    run_until_exact(picture)
    picture.prepare(ROUGHNESS)
    run_until_exact(picture)
    picture.prepare(F0)
    run_until_exact(picture)
    looks = [make_look(polished, lambda document, f0=f0: set_metal(document, 0.1, f0)) for f0 in (0.89, 0.87)]
    for look in looks:
        picture.set_look(look, active_pointer=F0)
        assert picture.advance(None).fidelity == Fidelity.APPROXIMATE
    shown, ball = picture.image(), masks(polished)[0]
    expected = run_until_exact(picture).image()
    # what other surfaces receive from the ball is of before
    assert np.linalg.norm((shown - expected)[ball]) < 0.02 * np.linalg.norm(expected[ball])


def test_preparation_ends_with_a_small_cache(polished):
    transfer = open_transfer(polished.store.path, Cache(1 << 20))
    picture = Picture(transfer, "front", Cache(BUDGET), is_watched=True)
    picture.set_look(rough(transfer, 0.4))
    run_until_exact(picture)
    picture.prepare(ROUGHNESS)
    for _ in range(50):
        picture.advance(None)
        job = picture.next_job()
        if job is None:
            break
        job.apply(job.run(lambda share: None, lambda: False))
    assert job is None
    picture.set_look(rough(transfer, 0.1), active_pointer=ROUGHNESS)
    assert picture.advance(None).fidelity == Fidelity.APPROXIMATE


def test_fewer_bounces_are_not_answered_by_the_earlier_light(polished, prepared):
    def edit(document):
        document["materials"]["Ball"]["terms"] = [METAL]
        document["transport"]["bounces"] = 1

    prepared.set_look(make_look(polished, edit), active_pointer="/transport/bounces")
    images = prepared._images
    assert not any(EARLIER_REFLECTANCES.is_ready(target, images.light) for target in images.targets())
