"""Environment triangles: they tile the sphere, preserve the light of every texel, and are small at bright regions."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import studio

from relume.assets.environments.equirect import halve_to_width, texel_directions, texel_solid_angles
from relume.core.color import luminance
from relume.core.errors import PlanError
from relume.lights.light_moments import F64, LightTexels, compute_moments
from relume.lights.sphere_tiles import MAX_DEPTH, Tiles
from relume.lights.spherical_triangles import EnvironmentTexels, integrate_environment, tessellate_environment
from relume.lights.tile_subdivision import MAX_LIGHTS, choose_tiles


def compute_moments_numpy(texels: LightTexels, mean: F64, frame: F64, tile: int) -> tuple[F64, F64]:
    """Reference of `compute_moments` for one tile in plain NumPy.

    Args:
        texels: of all tiles. mean: n of this tile. (3,) frame: its t. (2, 3) tile: its index.
    """
    _, luminous, directions, solid_angles = (each[texels.tile == tile] for each in texels)
    weight = luminous / luminous.sum()
    position = directions @ frame.T / (directions @ mean)[:, None]
    center = weight @ position
    offset = position - center
    return center, np.einsum("n,ni,nj->ij", weight, offset, offset) + np.eye(2) * (weight @ solid_angles) / 12


def solid_angles(corners):
    """Signed solid angles of triangles (M, 3, 3): positive if counter-clockwise (van Oosterom, Strackee 1983)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    volume = np.einsum("mc,mc->m", a, np.cross(b, c))
    dots = 1 + np.einsum("mc,mc->m", a, b) + np.einsum("mc,mc->m", b, c) + np.einsum("mc,mc->m", c, a)
    return 2 * np.arctan2(volume, dots)


def depth_inside(corners, directions):
    """Depth of each direction in each triangle: the sine of its distance to the nearest edge. (n, M)"""
    edges = np.cross(corners, np.roll(corners, -1, axis=1))
    edges /= np.linalg.norm(edges, axis=2, keepdims=True)
    return np.einsum("mec,nc->nme", edges, directions).min(axis=2)


def corners_of(lights):
    """(M, 3, 3) float64, unit"""
    corners = lights.nodes.astype(float).transpose(2, 1, 0)[:, :3]
    return corners / np.linalg.norm(corners, axis=2, keepdims=True)


def tiles_of(radiance, num_lights):
    """The tiles behind `tessellate_environment`, in its order: corners (M, 3, 3) and the texels in each."""
    tiles = choose_tiles(radiance, num_lights)
    tile = tiles.locate(texel_directions(*radiance.shape[:2]).reshape(-1, 3).astype(float))
    return tiles.corners, [np.nonzero(tile == m)[0] for m in range(len(tiles.codes))]


def texel_power(radiance):
    height, width, _ = radiance.shape
    return (radiance.astype(float) * texel_solid_angles(height, width)[:, None, None]).reshape(-1, 3)


@pytest.fixture(scope="module", params=[8, 100, 1003])
def lights(request):
    return tessellate_environment(studio(), request.param)


@pytest.mark.parametrize("num_lights", [8, 100, 1003])
def test_tiles_tile_the_sphere(num_lights):
    corners, _ = tiles_of(studio(), num_lights)
    angles = solid_angles(corners)
    assert angles.min() > 0
    assert angles.sum() == pytest.approx(4 * np.pi, rel=1e-9)
    directions = np.random.default_rng(1).normal(size=(3000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    depth = depth_inside(corners, directions)
    assert (depth.max(axis=1) > -1e-9).all()
    assert ((depth > 1e-9).sum(axis=1) <= 1).all()


def test_nodes_are_unit_and_midpoints_of_their_edges(lights):
    nodes = lights.nodes.astype(float).transpose(2, 1, 0)
    np.testing.assert_allclose(np.linalg.norm(nodes, axis=2), 1, atol=1e-6)
    middle = nodes[:, :3] + np.roll(nodes[:, :3], -1, axis=1)
    middle /= np.linalg.norm(middle, axis=2, keepdims=True)
    np.testing.assert_allclose(nodes[:, 3:], middle, atol=1e-6)
    assert solid_angles(corners_of(lights)).min() > 0  # counter-clockwise


@pytest.mark.parametrize("num_lights", [300, 1003])
def test_triangles_have_the_moments_of_their_light(num_lights):
    """Mean direction and spread in the tangent plane of each triangle, under uniform light."""
    radiance = studio(64)
    lights, (tiles, texels) = tessellate_environment(radiance, num_lights), tiles_of(radiance, num_lights)
    directions = texel_directions(64, 128).reshape(-1, 3).astype(float)
    weight, extent = luminance(texel_power(radiance)), np.repeat(texel_solid_angles(64, 128), 128)
    compared = 0
    for m, (corners, inside) in enumerate(zip(corners_of(lights), texels, strict=True)):
        if len(inside) == 0:
            assert not lights.irradiance[m].any()
            continue
        mean = weight[inside] @ directions[inside]
        mean /= np.linalg.norm(mean)
        np.testing.assert_allclose(lights.direction[m], mean, atol=1e-6)
        if (tiles[m] @ mean).min() < 0.85:
            continue  # too large for a tangent plane: the tile itself
        across = np.linalg.svd(mean[None])[2][1:]
        at, corner = (d @ across.T / (d @ mean)[:, None] for d in (directions[inside], corners))
        centre = weight[inside] @ at / weight[inside].sum()
        difference = at - centre
        spread = (weight[inside] * difference.T) @ difference / weight[inside].sum()
        spread += weight[inside] @ extent[inside] / weight[inside].sum() / 12 * np.eye(2)
        middle = corner.mean(axis=0)
        size = np.sqrt(np.trace(spread))
        np.testing.assert_allclose(middle, centre, atol=1e-4 * size)
        np.testing.assert_allclose((corner - middle).T @ (corner - middle) / 12, spread, atol=1e-3 * size**2)
        compared += 1
    assert compared > 0.8 * num_lights


def test_moments_of_texels_equal_their_reference():
    rng = np.random.default_rng(2)
    axis = np.eye(3)[rng.integers(0, 3, 400)]
    directions = axis + 0.3 * rng.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    tile = (2 * axis.argmax(axis=1)).astype(np.int32)
    texels = LightTexels(tile, rng.uniform(0, 9, 400), directions, rng.uniform(0, 0.1, 400))
    fitted = np.array([4, 0])  # of five tiles: two have no light and one is not requested
    mean, total = np.eye(3)[[2, 0]], texels.sums(texels.luminous, 5)
    frames = np.array([[[1.0, 0, 0], [0, 1, 0]], [[0, 0.6, 0.8], [0, -0.8, 0.6]]])
    centre, spread = compute_moments(texels, total[fitted], mean, frames, fitted)
    for k, of_tile in enumerate(fitted):
        expected = compute_moments_numpy(texels, mean[k], frames[k], of_tile)
        np.testing.assert_allclose(centre[k], expected[0], atol=1e-12)
        np.testing.assert_allclose(spread[k], expected[1], atol=1e-12)


def test_where_light_is_uniform_triangles_are_their_tiles():
    radiance = np.ones((256, 512, 3), np.float32)
    corners, (tiles, _) = corners_of(tessellate_environment(radiance, 300)), tiles_of(radiance, 300)
    angles = solid_angles(tiles)
    np.testing.assert_allclose(solid_angles(corners), angles, rtol=0.1)
    assert solid_angles(corners).sum() == pytest.approx(4 * np.pi, rel=0.02)
    assert np.linalg.norm(corners - tiles, axis=2).max() < 0.1 * np.sqrt(angles.max())


def test_power_equals_the_environments(lights):
    expected = texel_power(studio()).sum(axis=0)
    np.testing.assert_allclose(lights.irradiance.sum(axis=0, dtype=float), expected, rtol=1e-6)
    assert (lights.irradiance >= 0).all()


@pytest.mark.parametrize("num_lights", [8, 100, 700])
def test_each_texel_gives_its_light_to_the_one_triangle_it_lies_in(num_lights):
    radiance = np.random.default_rng(2).random((38, 76, 3), np.float32)  # only a few texels lie on an edge
    lights = tessellate_environment(radiance, num_lights)
    depth = depth_inside(tiles_of(radiance, num_lights)[0], texel_directions(38, 76).reshape(-1, 3).astype(float))
    owner, power = depth.argmax(axis=1), texel_power(radiance)
    on_edge = depth.max(axis=1) < 1e-6
    assert on_edge.mean() < 0.05
    inside = np.zeros((lights.num_lights, 3))
    np.add.at(inside, owner[~on_edge], power[~on_edge])
    touching = np.zeros(lights.num_lights, bool)
    touching[np.nonzero((depth[on_edge] > -1e-6).any(axis=0))[0]] = True
    np.testing.assert_allclose(lights.irradiance[~touching], inside[~touching], rtol=1e-5, atol=1e-9)
    assert (lights.irradiance - inside > -1e-6).all()
    np.testing.assert_allclose((lights.irradiance - inside).sum(axis=0), power[on_edge].sum(axis=0), atol=1e-5)


def test_shadow_ray_directions_lie_in_their_triangle(lights):
    np.testing.assert_allclose(np.linalg.norm(lights.direction, axis=1), 1, atol=1e-6)
    depth = np.diagonal(depth_inside(corners_of(lights), lights.direction.astype(float)))
    assert (depth > -1e-6).all()
    radiance = studio()
    towards = (luminance(texel_power(radiance))[:, None] * texel_directions(32, 64).reshape(-1, 3)).sum(axis=0)
    weighted = (luminance(lights.irradiance.astype(float))[:, None] * lights.direction).sum(axis=0)
    cosine = weighted @ towards / np.linalg.norm(weighted) / np.linalg.norm(towards)
    assert cosine > np.cos(np.radians(1.0))


def test_same_environment_gives_the_same_triangles_bit_for_bit():
    first, second = tessellate_environment(studio(), 300), tessellate_environment(studio(), 300)
    for name in ("nodes", "direction", "irradiance"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


@pytest.mark.parametrize("requested", [8, 9, 10, 11, 100, 101, 102, 500])
def test_the_number_of_triangles_is_the_requested_one_at_most(requested):
    count = tessellate_environment(studio(), requested).num_lights
    assert requested - 3 < count <= requested
    assert (count - 8) % 3 == 0


@pytest.mark.parametrize("spot", [(6, 10), (32, 80), (58, 126)])
def test_small_triangles_lie_on_bright_spots(spot):
    y, x = spot
    radiance = np.full((64, 128, 3), 0.1, np.float32)
    radiance[y - 2 : y + 3, x - 2 : x + 2] = 500.0
    lights = tessellate_environment(radiance, 500)
    angles, mean = solid_angles(tiles_of(radiance, 500)[0]), 4 * np.pi / 500
    bright = lights.irradiance.sum(axis=1) / angles > 100
    assert bright.sum() >= 15  # of its twenty texels
    assert angles[bright].mean() < mean / 10
    assert angles.max() > mean  # large in uniform regions


def test_uniform_light_is_divided_evenly():
    angles = solid_angles(tiles_of(np.ones((64, 128, 3), np.float32), 512)[0])
    assert angles.max() / angles.min() < 12  # one level apart; children of an octahedron differ in size


def test_a_black_environment_has_black_lights_over_the_whole_sphere():
    lights = tessellate_environment(np.zeros((8, 16, 3), np.float32), 200)
    assert solid_angles(corners_of(lights)).sum() == pytest.approx(4 * np.pi, rel=1e-6)
    assert not lights.irradiance.any()
    np.testing.assert_allclose(np.linalg.norm(lights.direction, axis=1), 1, atol=1e-6)


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (2, 1), (2, 4), (3, 5)])
def test_subdivision_of_tiny_maps_terminates(shape):
    radiance = np.random.default_rng(3).random((*shape, 3), np.float32)
    lights = tessellate_environment(radiance, 4000)
    assert lights.num_lights <= 4000
    assert np.isfinite(lights.direction).all()
    assert np.isfinite(lights.nodes).all()
    assert solid_angles(tiles_of(radiance, 4000)[0]).sum() == pytest.approx(4 * np.pi, rel=1e-9)
    np.testing.assert_allclose(lights.irradiance.sum(axis=0, dtype=float), texel_power(radiance).sum(axis=0), rtol=1e-6)


@pytest.mark.parametrize("value", [1e-30, 1e6])
def test_one_texel_of_light_is_kept_however_bright_or_dim(value):
    radiance = np.zeros((16, 32, 3), np.float32)
    radiance[4, 9] = [value, 0, value / 2]
    lights = tessellate_environment(radiance, 1000)
    lit = lights.irradiance.any(axis=1)
    assert lit.sum() == 1
    np.testing.assert_allclose(lights.irradiance[lit][0], texel_power(radiance).sum(axis=0), rtol=1e-6)
    assert lights.direction[lit][0] @ texel_directions(16, 32)[4, 9] == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("requested", [-1, 0, 7, MAX_LIGHTS + 1])
def test_invalid_counts_are_rejected(requested):
    with pytest.raises(PlanError, match="give 8 to"):
        tessellate_environment(np.ones((2, 4, 3), np.float32), requested)


@pytest.mark.parametrize("columns", [0, 3, 16, 40])
def test_a_rotated_environment_equals_its_rotated_image(columns):
    radiance = studio()  # 64 texels wide
    tiles = choose_tiles(radiance, 200)
    rotated = integrate_environment(tiles, EnvironmentTexels.from_radiance(radiance), 360 * columns / 64)
    rolled = integrate_environment(tiles, EnvironmentTexels.from_radiance(np.roll(radiance, -columns, axis=1)))
    # a texel center that rounding moves across an edge changes two tiles; most tiles have none there
    same = np.isclose(rotated.irradiance, rolled.irradiance, rtol=1e-5, atol=1e-9).all(axis=1)
    assert same.mean() > 0.9
    np.testing.assert_allclose(rotated.direction[same], rolled.direction[same], atol=1e-5)
    np.testing.assert_allclose(
        rotated.irradiance.sum(axis=0, dtype=float), rolled.irradiance.sum(axis=0, dtype=float), rtol=1e-5
    )


def test_another_environment_keeps_its_light_in_the_same_tiles():
    tiles = choose_tiles(studio(), 300)
    other = np.random.default_rng(4).random((38, 76, 3), np.float32)
    lights = integrate_environment(tiles, EnvironmentTexels.from_radiance(other))
    np.testing.assert_allclose(lights.irradiance.sum(axis=0, dtype=float), texel_power(other).sum(axis=0), rtol=1e-6)
    depth = np.diagonal(depth_inside(tiles.corners, lights.direction.astype(float)))
    assert (depth > -1e-6).all()


@pytest.mark.parametrize("relightable", [False, True])
def test_directions_are_located_in_the_tile_they_lie_in(relightable):
    tiles = choose_tiles(studio(), 500, relightable)
    directions = np.random.default_rng(7).normal(size=(4000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    tile = tiles.locate(directions)
    depth = depth_inside(tiles.corners, directions)
    assert (depth[np.arange(len(tile)), tile] > -1e-9).all()
    np.testing.assert_array_equal(tiles.locate(tiles.centroids), np.arange(len(tiles.codes)))
    np.testing.assert_array_equal(tiles.locate(tiles.corners.mean(axis=1)), np.arange(len(tiles.codes)))


def test_relightable_tiles_do_not_depend_on_the_rotation():
    radiance = studio()
    tiles = choose_tiles(radiance, 400, relightable=True)
    np.testing.assert_array_equal(tiles.codes, choose_tiles(np.roll(radiance, 9, axis=1), 400, relightable=True).codes)
    angles = solid_angles(tiles.corners)
    plain = solid_angles(choose_tiles(radiance, 400).corners)
    assert angles.max() / angles.min() < plain.max() / plain.min()


@pytest.mark.parametrize(
    "codes",
    [
        [],
        range(8, 15),
        [*range(8, 16), 8],
        [*range(9, 16), 32, 33, 34],
        [*range(8, 16), 32],
        [*range(8, 15), 7],
        [*range(8, 15), 31],
        [*range(8, 15), 15 << (2 * MAX_DEPTH + 2)],
    ],
)
def test_codes_that_do_not_tile_the_sphere_are_rejected(codes):
    assert not Tiles(np.array(list(codes), np.uint64)).is_whole()


@pytest.mark.parametrize("num_lights", [8, 11, 500])
def test_selected_tiles_are_complete(num_lights):
    assert choose_tiles(studio(), num_lights).is_whole()


def test_a_downsampled_map_has_the_same_power():
    whole = studio().repeat(4, axis=0).repeat(4, axis=1)
    small = halve_to_width(whole, studio().shape[1])
    np.testing.assert_allclose(small, studio(), rtol=1e-6)
    assert halve_to_width(small[:, :-1], 4).shape == small[:, :-1].shape  # an odd side cannot be halved
    tiles = choose_tiles(studio(), 60)
    few, all_texels = (
        integrate_environment(tiles, EnvironmentTexels.from_radiance(texels)).irradiance.sum(0)
        for texels in (small, whole)
    )
    np.testing.assert_allclose(few, all_texels, rtol=1e-2)
