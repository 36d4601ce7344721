"""Example scenes with indirect light: front faces are visible, and light reaches the interior."""

from __future__ import annotations

import numpy as np
import pytest

from relume.camera.view_samples import BACKGROUND, sample_view
from relume.raytrace.scene_buffers import build_scene_buffers
from relume.scene.examples.cornell import cornell_box, lamplit_cornell_box
from relume.scene.examples.interior import interior
from relume.scene.examples.tableau import tableau

SCENES = {"cornell": cornell_box, "lamplit": lamplit_cornell_box, "interior": interior, "tableau": tableau}


@pytest.mark.parametrize("name", SCENES)
def test_no_back_face_is_visible(name):
    scene = SCENES[name]()
    for mesh in scene.meshes:
        a, b, c = (mesh.positions[mesh.faces[:, k]].astype(float) for k in range(3))
        agrees = np.einsum("nc,nc->n", np.cross(b - a, c - a), mesh.normals[mesh.faces[:, 0]].astype(float)) > 0
        assert agrees.mean() > 0.99, mesh.name


@pytest.mark.parametrize("name", SCENES)
def test_all_materials_are_visible(name):
    scene = SCENES[name]()
    samples = sample_view(scene, build_scene_buffers(scene), "front", (64, 64))
    assert set(range(len(scene.materials))) <= set(samples.material.tolist()) - {BACKGROUND}


def test_the_floor_of_the_box_may_be_glossy():
    plain, glossy = (cornell_box(is_floor_glossy).materials[0].terms for is_floor_glossy in (False, True))
    assert [len(terms) for terms in (plain, glossy)] == [1, 2]
