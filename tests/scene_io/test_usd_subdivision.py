"""Subdivision surfaces of USD against the rules of Catmull and Clark, worked by hand."""

from __future__ import annotations

import numpy as np
import pytest
from usd_text import imported, quad, usda

from relume.scene_io.placement import area, bounds
from relume.scene_io.usd import meshes
from relume.scene_io.usd.polygon_mesh import PolygonMesh, Primvar
from relume.scene_io.usd.shapes import _cube
from relume.scene_io.usd.subdivision import NO_CREASES, Creases, subdivide

NONE = np.zeros(0)


def edges(pairs: list[list[int]], sharpness: float) -> Creases:
    return Creases(np.array(pairs), np.full(len(pairs), sharpness), np.zeros(0, np.int64), NONE)


def test_a_cube_becomes_round_by_the_rules_of_catmull_and_clark() -> None:
    refined = subdivide(_cube(2.0), NO_CREASES, 1)
    assert len(refined.points) == 8 + 12 + 6
    assert len(refined.lengths) == 24
    # vertices (Q + 2 R + 0 S) / 3 with Q = 1/3 and R = 2/3 of a corner; edges (1 + 1 + 1/2 + 1/2) / 4; faces stay
    np.testing.assert_allclose(np.abs(refined.points[:8]), 5 / 9)
    np.testing.assert_allclose(np.sort(np.abs(refined.points[8:20]), axis=1), [[0, 0.75, 0.75]] * 12)
    np.testing.assert_allclose(np.sort(np.abs(refined.points[20:]), axis=1), [[0, 0, 1]] * 6)
    np.testing.assert_array_equal(np.bincount(refined.face), [4] * 6)


def test_sharp_edges_and_corners_keep_a_cube() -> None:
    cube = _cube(2.0)
    starts = cube.vertex.reshape(-1, 4)
    all_edges = np.stack([starts, np.roll(starts, -1, axis=1)], axis=-1).reshape(-1, 2).tolist()
    np.testing.assert_allclose(np.abs(subdivide(cube, edges(all_edges, 10.0), 2).points).max(axis=1), 1)
    corners = Creases(np.zeros((0, 2), np.int64), NONE, np.arange(8), np.full(8, 10.0))
    np.testing.assert_allclose(np.abs(subdivide(cube, corners, 1).points[:8]), 1)


@pytest.mark.parametrize(("sharpness", "middle"), [(0.0, 0.75), (0.5, 0.875), (1.0, 1.0)])
def test_edges_between_smooth_and_sharp_are_interpolated(sharpness: float, middle: float) -> None:
    refined = subdivide(_cube(2.0), edges([[0, 1]], sharpness), 1)
    new = refined.points[8:20]
    along_z = new[(new[:, 0] < 0) & (new[:, 1] < 0)]
    np.testing.assert_allclose(along_z, [[-middle, -middle, 0]])


def test_boundaries_stay_and_their_corners_are_sharp_unless_the_mesh_says_otherwise() -> None:
    points = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], float)
    mesh = PolygonMesh(points, np.array([4]), np.arange(4), np.arange(1))
    np.testing.assert_allclose(subdivide(mesh, NO_CREASES, 1).points[:4], points)
    round_corners = Creases(np.zeros((0, 2), np.int64), NONE, np.zeros(0, np.int64), NONE, has_sharp_corners=False)
    np.testing.assert_allclose(subdivide(mesh, round_corners, 1).points[0], [0.5, 0.5, 0])


def test_primvars_are_refined_with_their_own_seams() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0]], float)
    vertex = np.array([0, 1, 4, 3, 1, 2, 5, 4])
    seam = Primvar(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float), np.array([0, 1, 2, 3, 0, 1, 2, 3]))
    mesh = PolygonMesh(points, np.array([4, 4]), vertex, np.arange(2), {"st": seam})
    refined = subdivide(mesh, NO_CREASES, 1)
    values = refined.primvars["st"].values[refined.primvars["st"].index].reshape(-1, 4, 2)
    np.testing.assert_allclose(values.min(axis=(0, 1)), 0)
    np.testing.assert_allclose(values.max(axis=(0, 1)), 1)
    np.testing.assert_allclose(np.ptp(values, axis=1), 0.5)  # each quadrilateral covers a quarter of the image


CUBE = """
def Mesh "Block"
{
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]
    point3f[] points = [
        (-1, -1, -1), (-1, -1, 1), (-1, 1, -1), (-1, 1, 1), (1, -1, -1), (1, -1, 1), (1, 1, -1), (1, 1, 1)
    ]
    %s
}
"""


def test_meshes_are_subdivision_surfaces_unless_they_say_otherwise() -> None:
    scene = imported(usda(CUBE % ""))
    assert len(scene.meshes[0].faces) == 6 * 16 * 2
    assert "1 subdivision surface is refined at most twice." in scene.warnings
    normals, positions = scene.meshes[0].normals, scene.meshes[0].positions
    lengths = np.linalg.norm(positions, axis=1, keepdims=True)
    assert (normals * positions / lengths).sum(axis=1).min() > 0.95
    for polygons in ('uniform token subdivisionScheme = "none"', 'uniform token subdivisionScheme = "bilinear"'):
        assert area(imported(usda(CUBE % polygons))) == pytest.approx(24)
    # many programs write normals, but no scheme
    flat = 'normal3f[] normals = [(0, 0, 1)] (\n interpolation = "constant"\n)'
    assert area(imported(usda(CUBE % flat))) == pytest.approx(24)


def test_creases_of_a_file_are_chains_with_one_sharpness_or_one_for_each_edge() -> None:
    for sharpnesses in ("[10]", "[10, 10, 10, 10]"):
        chain = f"""int[] creaseIndices = [1, 5, 7, 3, 1]
    int[] creaseLengths = [5]
    float[] creaseSharpnesses = {sharpnesses}"""
        scene = imported(usda(CUBE % chain))
        assert bounds(scene)[1][2] == pytest.approx(1)  # the face +z stays where it is
        assert bounds(scene)[0][2] > -0.9


def test_holes_of_subdivision_surfaces_are_left_out_after_the_refinement() -> None:
    closed, open_box = (imported(usda(CUBE % holes)) for holes in ("", "int[] holeIndices = [0]"))
    assert len(open_box.meshes[0].faces) == len(closed.meshes[0].faces) * 5 // 6
    assert bounds(open_box)[1][0] == bounds(closed)[1][0]


def test_large_surfaces_and_other_schemes_have_their_control_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    loop = imported(usda(CUBE % 'uniform token subdivisionScheme = "loop"'))
    assert area(loop) == pytest.approx(24)
    assert any("Subdivision “loop” of mesh “Block” isn't supported" in warning for warning in loop.warnings)
    monkeypatch.setattr(meshes, "MAX_REFINED", 50)
    assert len(imported(usda(CUBE % "")).meshes[0].faces) == 48
    monkeypatch.setattr(meshes, "MAX_REFINED", 10)
    large = imported(usda(CUBE % "" + quad()))
    assert area(large) == pytest.approx(24 + 4)
    assert any("has too many faces; it has the shape of its control mesh" in warning for warning in large.warnings)
