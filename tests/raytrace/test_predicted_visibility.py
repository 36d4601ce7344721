"""Predicted visibility against full tracing, against plain Python, and in the hardest cases."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import make_camera, make_tiny_scene, quad, still_life, studio

from relume.camera.view_samples import BACKGROUND, sample_view
from relume.core.color import luminance
from relume.lights.neighbors import find_neighbors
from relume.lights.spherical_triangles import TriangleLights, tessellate_environment
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.raytrace.visibility import trace_visibility
from relume.raytrace.visibility_masks import make_light_targets, trace_visibility_masks
from relume.scene.examples.still_life import demo_scene

UNKNOWN, LIT, HIDDEN, BELOW = range(4)
# Allowed difference from a fully traced bake: bits, and relative RMSE of an image. These images are a
# fiftieth of the usual size, so that shadows change over fewer samples than they do in a bake.
WRONG_SHARE, PICTURE_CHANGE = 1e-3, 1e-3
HARDEST_CHANGE = 3e-3  # all shadows are one or two pixels wide, below the resolution of the image


def bits_of(visible, num_lights):
    return np.unpackbits(visible, axis=1, bitorder="little")[:, :num_lights].astype(bool)


def samples_of(scene, size, view=None):
    geometry = build_scene_buffers(scene)
    samples = sample_view(scene, geometry, view or scene.cameras[0].name, size)
    solid = samples.material != BACKGROUND
    return geometry, samples.surface.points.position[solid], samples.surface.points.normal[solid]


def trace_and_predict(scene, size, num_lights):
    """Bits of the full trace and predicted bits, the irradiance of each, and the counts."""
    geometry, position, normal = samples_of(scene, size)
    lights = tessellate_environment(scene.environment.radiance, num_lights)
    full = trace_visibility(geometry.embree, position, normal, lights.direction)
    predicted = trace_visibility_masks(
        geometry.embree, position, normal, make_light_targets(lights.direction, lights.irradiance)
    )
    count = lights.num_lights
    assert predicted.rays.num_full == full.num_rays
    cosine = np.maximum(normal @ lights.direction.T, 0)
    return (
        bits_of(full.visible, count),
        bits_of(predicted.visible, count),
        cosine * lights.irradiance[:, 1],
        predicted.rays,
    )


def in_pixels(scene, size, values):
    """Values of surface samples weighted into pixels. (pixels,)"""
    samples = sample_view(scene, build_scene_buffers(scene), scene.cameras[0].name, size)
    solid = samples.material != BACKGROUND
    return np.bincount(samples.pixel[solid], samples.weight[solid] * values, minlength=size[0] * size[1])


def image_error(scene, size, full, predicted, weight):
    """Relative RMSE of an image of the irradiance."""
    right, wrong = (in_pixels(scene, size, (bits * weight).sum(axis=1)) for bits in (full, predicted))
    return np.sqrt(np.mean((wrong - right) ** 2) / np.mean(right**2))


def fence():
    """Wires a third of a pixel thin in front of a floor and a wall: samples of every level see between them."""
    wires = [
        quad(f"wire{k}", [[x, 0, 0.5], [x + 0.004, 0, 0.5], [x + 0.004, 1, 0.5], [x, 1, 0.5]], 0)
        for k, x in enumerate(np.linspace(-1, 1, 41))
    ]
    floor = quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0)
    wall = quad("wall", [[-2, 0, -0.5], [2, 0, -0.5], [2, 1.5, -0.5], [-2, 1.5, -0.5]], 0)
    camera = make_camera("c", [0, 1.6, 2.4], [0, 0.3, 0], 0.7)
    return make_tiny_scene(*wires, floor, wall, camera=camera, environment=studio(64))


def close_tiles():
    """Tiles close above a floor: contact shadows a few pixels wide, between the first traced samples."""
    floor = quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0)
    tiles = [
        quad(f"lid{k}", [[x, 0.01, z + 0.02], [x + 0.02, 0.01, z + 0.02], [x + 0.02, 0.01, z], [x, 0.01, z]], 0)
        for k, (x, z) in enumerate(np.random.default_rng(2).uniform(-0.4, 0.4, (30, 2)))
    ]
    return make_tiny_scene(
        floor, *tiles, camera=make_camera("c", [0, 0.6, 1.2], [0, 0, 0], 0.7), environment=studio(64)
    )


def first_of(lights, count):
    return TriangleLights(lights.nodes[..., :count], lights.direction[:count], lights.irradiance[:count])


@pytest.mark.parametrize(
    ("scene", "num_lights", "saving", "bound"),
    [
        (demo_scene, 1000, 2.0, PICTURE_CHANGE),
        (still_life, 300, 1.5, PICTURE_CHANGE),
        (close_tiles, 1000, 2.0, HARDEST_CHANGE),
        (fence, 1000, 2.0, HARDEST_CHANGE),
    ],
)
def test_predicted_bits_equal_full_tracing(scene, num_lights, saving, bound):
    made, size = scene(), (96, 72)
    full, predicted, weight, rays = trace_and_predict(made, size, num_lights)
    wrong = (full != predicted).sum() / rays.num_full
    assert wrong <= WRONG_SHARE
    assert image_error(made, size, full, predicted, weight) <= bound
    assert rays.num_full > saving * rays.num_traced
    assert rays.num_checked > 0
    # the estimate is the error before correction: right within three deviations of the count
    assert wrong <= rays.error_rate + 3 * np.sqrt(rays.num_wrong + 9) / max(1, rays.num_checked)
    assert 0.1 < full[weight > 0].mean() < 0.999


def predict_numpy(visible, facing, position, lights):
    """Bits and number of rays, sample by sample, from the results of a full trace."""
    neighbors, power = find_neighbors(lights.direction), luminance(lights.irradiance)
    beside, strong = np.split(neighbors.neighbors, neighbors.first[1:-1]), power > 5e-3 * power.sum()
    bits, rays = np.zeros_like(visible), 0
    for start in range(0, len(visible), 64):
        rows = np.arange(start, min(start + 64, len(visible)))
        is_traced = np.zeros_like(visible)
        everything, nothing = np.ones(visible.shape[1], bool), np.full(visible.shape[1], UNKNOWN)
        whole, doubt = flood(visible, facing, is_traced, rows, ends(position, rows), nothing, everything, beside)
        for quarter in np.split(rows, range(16, len(rows), 16)):
            held, deep = flood(
                visible, facing, is_traced, quarter, ends(position, quarter), whole, doubt | strong, beside
            )
            held, _ = flood(visible, facing, is_traced, quarter, quarter, held, deep | strong, beside)
            for light in range(visible.shape[1]):
                number = ((light + quarter[0]) * 2_654_435_761 & 0xFFFFFFFF) * 128 >> 32
                if number < len(quarter) and held[light] in (LIT, HIDDEN):
                    row = quarter[number]
                    assert (
                        is_traced[row, light] or not facing[row, light] or visible[row, light] == (held[light] == LIT)
                    )
                    is_traced[row, light] |= facing[row, light]
            bits[quarter] = np.where(is_traced[quarter], visible[quarter], facing[quarter] & (held == LIT))
        rays += is_traced.sum()
    return bits, rays


def ends(position, rows):
    here = position[rows].astype(np.float64)
    farthest = np.argmax(((here - here.mean(axis=0)) ** 2).sum(axis=1))
    return rows[[farthest, np.argmax(((here - here[farthest]) ** 2).sum(axis=1))]]


def predict(visible, facing, is_traced, rows, light):
    if not facing[rows, light].any():
        return BELOW
    answers = visible[rows, light][is_traced[rows, light]]
    return UNKNOWN if len(answers) == 0 or answers.any() != answers.all() else LIT if answers.all() else HIDDEN


def flood(visible, facing, is_traced, rows, samples, before, doubt, beside):
    lights = range(visible.shape[1])
    held = np.array([before[m] if facing[rows, m].any() else BELOW for m in lights])
    queue = [m for m in lights if held[m] != BELOW and doubt[m]]
    for m in queue:  # grows during the loop
        is_traced[samples, m] |= facing[samples, m]
        held[m] = predict(visible, facing, is_traced, rows, m)
        answers = visible[rows, m][is_traced[rows, m]]
        if (before[m] == LIT and not answers.all()) or (before[m] == HIDDEN and answers.any()):
            queue += [o for o in beside[m] if o not in queue and held[o] != BELOW]
    doubted = np.zeros(len(held), bool)
    for m in queue:
        doubted[m] = held[m] == UNKNOWN or any(held[o] not in (BELOW, held[m]) for o in beside[m])
    return held, doubted


def test_the_prediction_kernel_equals_its_reference():
    geometry, position, normal = samples_of(still_life(), (26, 20))
    lights = tessellate_environment(studio(), 300)
    visible = bits_of(trace_visibility(geometry.embree, position, normal, lights.direction).visible, lights.num_lights)
    actual = trace_visibility_masks(
        geometry.embree, position, normal, make_light_targets(lights.direction, lights.irradiance)
    )
    assert actual.rays.num_wrong == 0  # the reference does not correct
    bits, rays = predict_numpy(visible, normal @ lights.direction.T > 0, position, lights)
    np.testing.assert_array_equal(bits_of(actual.visible, lights.num_lights), bits)
    assert actual.rays.num_traced == rays


@pytest.mark.parametrize("num_samples", [1, 2, 15, 17, 63, 65, 130])
@pytest.mark.parametrize("num_lights", [1, 9])
def test_any_number_of_samples_and_lights(num_samples, num_lights):
    geometry, position, normal = samples_of(still_life(), (48, 36))
    position, normal = position[:num_samples], normal[:num_samples]
    lights = first_of(tessellate_environment(studio(), 50), num_lights)
    actual = trace_visibility_masks(
        geometry.embree, position, normal, make_light_targets(lights.direction, lights.irradiance)
    )
    full = trace_visibility(geometry.embree, position, normal, lights.direction)
    assert actual.visible.shape == full.visible.shape
    assert actual.rays.num_traced <= actual.rays.num_full == full.num_rays
    if num_samples <= 2:  # all samples are traced
        np.testing.assert_array_equal(actual.visible, full.visible)
    assert not np.unpackbits(actual.visible, axis=1, bitorder="little")[:, num_lights:].any()


def test_nothing_to_predict_is_no_error():
    geometry, position, normal = samples_of(still_life(), (24, 18))
    lights = tessellate_environment(studio(), 50)
    actual = trace_visibility_masks(
        geometry.embree, position[:0], normal[:0], make_light_targets(lights.direction, lights.irradiance)
    )
    assert actual.visible.shape == (0, 7)
    assert actual.rays.num_traced == actual.rays.num_full == 0
    assert actual.rays.error_rate == 0


def test_threads_change_neither_bits_nor_counts(monkeypatch):
    geometry, position, normal = samples_of(still_life(), (96, 72))
    lights = tessellate_environment(studio(), 100)
    results = []
    for threads in ("1", "3"):
        monkeypatch.setenv("RELUME_THREADS", threads)
        results.append(
            trace_visibility_masks(
                geometry.embree, position, normal, make_light_targets(lights.direction, lights.irradiance)
            )
        )
    np.testing.assert_array_equal(results[0].visible, results[1].visible)
    assert results[0].rays == results[1].rays
