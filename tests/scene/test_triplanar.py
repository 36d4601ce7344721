"""Tri-planar mapping of materials whose triangles have no UV coordinates."""

from dataclasses import replace

import numpy as np
from tiny_scenes import make_camera, make_tiny_scene, quad

from relume.scene.triplanar import find_triplanar

CORNERS = [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]
CAMERA = make_camera("front", [0, 2, 2], [0, 0, 0], 0.8)


def mesh(name, material, is_mapped):
    places = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    return replace(quad(name, CORNERS, material), uvs=places if is_mapped else np.zeros_like(places))


def test_the_majority_of_triangles_decides():
    def found(*meshes):
        return find_triplanar(make_tiny_scene(*meshes, camera=CAMERA))

    assert found(mesh("bare", 0, False), mesh("mapped", 1, True)) == [True, False]
    mixed = [mesh("bare", 1, False), mesh("mapped", 1, True), mesh("again", 1, True)]
    assert found(mesh("first", 0, True), *mixed) == [False, False]
