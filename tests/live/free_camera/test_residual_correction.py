"""Residual correction of an image from a few exact samples, against loops over pixels and samples."""

import numpy as np
import pytest

from relume.live.free_camera.residual_correction import CorrectionSamples, apply_residual, residual

STEP, WIDTH, HEIGHT = 4, 48, 32


def make_gbuffer(width, height):
    """Two materials that meet in the center, one curved, under a strip of background, viewed along −Z."""
    y, x = np.divmod(np.arange(width * height), width)
    u, v = (x + 0.5) / width * WIDTH, (y + 0.5) / height * HEIGHT
    along = np.maximum(u - WIDTH / 2, 0)
    bend = np.arctan(0.01 * along)
    position = np.stack([u, v, -0.005 * along**2], axis=1).astype(np.float32)
    normal = np.stack([np.sin(bend), 0 * u, np.cos(bend)], axis=1).astype(np.float32)
    material = np.where(v < 4, -1, (u >= WIDTH / 2).astype(int)).astype(np.int32)
    return CorrectionSamples(position, normal, material, width)


def similarity(at, p, samples, q):
    if at.material[p] < 0 or at.material[p] != samples.material[q]:
        return 0.0
    away = at.position[p].astype(np.float64) - samples.position[q]
    turn = max(float(at.normal[p].astype(np.float64) @ samples.normal[q]), 0)
    rise = abs(float(at.normal[p].astype(np.float64) @ away))
    return turn**8 * np.exp(-rise / (0.1 * np.linalg.norm(away) + 1e-9))


def mean(weights, difference):
    return sum(w * difference[q] for q, w in weights) / (sum(w for _, w in weights) + 0.02) if weights else np.zeros(3)


def weights_around(samples, q):
    """Weights of the samples around one."""
    y, x = divmod(q, samples.width)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            if (dx, dy) != (0, 0) and 0 <= x + dx < samples.width and 0 <= y + dy < samples.height:
                other = (y + dy) * samples.width + x + dx
                yield other, similarity(samples, q, samples, other) * (0.5 if dx and dy else 1)


def expected(difference, samples, pixels):
    belief = np.zeros(len(difference))
    for material in (0, 1):
        rows = [q for q in range(len(difference)) if samples.material[q] == material]
        differences = {q: mean([(o, w) for o, w in weights_around(samples, q) if w > 0], difference) for q in rows}
        sums, size, whole = sum(
            np.array([differences[q] @ difference[q], differences[q] @ differences[q], difference[q] @ difference[q]])
            for q in rows
        )
        explained = max(sums, 0) ** 2 / (size * whole)
        belief[rows] = min(sums / size, 1) if explained > 0.2 else 0
    out = np.zeros((len(pixels.material), 3))
    for p in range(len(out)):
        y, x = divmod(p, pixels.width)
        u, v = (x + 0.5) / STEP - 0.5, (y + 0.5) / STEP - 0.5
        weights = []
        for q in range(len(difference)):
            row, column = divmod(q, samples.width)
            tent = max(1 - abs(u - column), 0) * max(1 - abs(v - row), 0)
            if tent > 0:
                weights.append((q, tent * similarity(pixels, p, samples, q)))
        out[p] = mean(weights, belief[:, None] * difference)
    return out


@pytest.fixture(scope="module")
def corrected_twice():
    return make_gbuffer(WIDTH // STEP, HEIGHT // STEP), make_gbuffer(WIDTH, HEIGHT)


def image(samples, values):
    return values.reshape(samples.height, samples.width, 3).astype(np.float32)


def test_the_interpolated_residual_equals_loops(corrected_twice):
    samples, pixels = corrected_twice
    rng = np.random.default_rng(7)
    smooth = 0.1 * samples.position[:, :1] * [1, 0.5, 0.2]
    difference = np.where(samples.material[:, None] == 0, smooth, rng.normal(size=smooth.shape))
    difference[samples.material < 0] = 0
    radiance = rng.random(difference.shape) + 2
    by = residual(image(samples, radiance), image(samples, radiance + difference), samples, pixels)
    wanted = image(pixels, expected(difference, samples, pixels))
    np.testing.assert_allclose(by, wanted, atol=2e-6)
    assert np.abs(by).max() > 0.1
    assert not by[:4].any()  # the background is always exact


def test_smooth_residuals_are_corrected_and_noise_is_rejected(corrected_twice):
    samples, pixels = corrected_twice

    def smooth(at):
        return np.repeat(0.5 + 0.01 * at.position[:, :1], 3, axis=1) * (at.material >= 0)[:, None]

    zero = np.zeros((len(samples.material), 3))
    by = residual(image(samples, zero), image(samples, smooth(samples)), samples, pixels)
    wanted = image(pixels, smooth(pixels))
    assert np.sqrt(np.mean((by - wanted) ** 2)) < 0.1 * np.sqrt(np.mean(wanted**2))
    noise = np.random.default_rng(3).normal(size=zero.shape)
    by = residual(image(samples, zero), image(samples, noise), samples, pixels)
    assert not by.any()


def test_samples_at_edges_have_no_weight(corrected_twice):
    samples, _ = corrected_twice
    edges = np.array([10 * WIDTH + 21, 11 * WIDTH])  # a sample lies at x = 22, y = 10; the other is far from any
    left = samples.exclude_edges(edges, (WIDTH, HEIGHT)).material
    assert np.flatnonzero(left != samples.material).tolist() == [2 * samples.width + 5]
    assert left[2 * samples.width + 5] == -1


def test_corrected_values_are_not_negative():
    corrected = apply_residual(np.full((1, 2, 3), 0.5, np.float32), np.float32([[[-1, 0, 1], [0.25, -0.5, -0.25]]]))
    np.testing.assert_array_equal(corrected, np.float32([[[0, 0.5, 1.5], [0.75, 0, 0.25]]]))
