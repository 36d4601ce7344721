"""The built-in still life: valid geometry, no floating or intersecting objects, deterministic."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from relume.assets.environments.equirect import texel_directions, texel_solid_angles
from relume.assets.environments.studio import studio
from relume.brdf.registry import TERMS
from relume.scene.examples.still_life import demo_scene, still_life
from relume.scene.examples.still_life.palette import materials
from relume.scene.examples.still_life.teapot import patches, teapot, tessellate
from relume.scene.model import Mesh, Scene
from relume.scene.scene_folder import make_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return demo_scene()


@pytest.fixture(scope="module")
def meshes(scene: Scene) -> dict[str, Mesh]:
    return {mesh.name: mesh for mesh in scene.meshes}


def test_the_scene_is_the_same_every_time(scene: Scene) -> None:
    again = make_scene(scene.name, still_life.meshes(), materials(), still_life.cameras(), studio())
    assert again.id == scene.id


def test_the_scene_is_small_enough_for_a_quick_bake(scene: Scene) -> None:
    assert 30_000 < sum(len(mesh.faces) for mesh in scene.meshes) < 100_000


def test_frames_are_orthonormal(scene: Scene) -> None:
    for mesh in scene.meshes:
        tangents = mesh.tangents[:, :3]
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
        np.testing.assert_allclose(np.linalg.norm(tangents, axis=1), 1, atol=1e-5)
        np.testing.assert_allclose((mesh.normals * tangents).sum(1), 0, atol=1e-5)
        assert set(np.unique(mesh.tangents[:, 3])) == {1.0}


def test_faces_are_oriented_like_their_normals(scene: Scene) -> None:
    for mesh in scene.meshes:
        corners = mesh.positions[mesh.faces].astype(np.float64)
        faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        faces /= np.linalg.norm(faces, axis=1, keepdims=True)
        assert (faces * mesh.normals[mesh.faces].mean(1)).sum(1).min() > 0.3, mesh.name


def test_the_table_faces_both_views(scene: Scene, meshes: dict[str, Mesh]) -> None:
    """It is no closed surface: a renderer with back-face culling must show it."""
    mesh = meshes["Table"]
    for camera in scene.cameras:
        towards = camera.to_world[:3, 3] - mesh.positions
        assert np.mean((mesh.normals * towards).sum(axis=1) > 0) > 0.95


def test_spheres_and_shells_are_closed_and_oriented_outward(meshes: dict[str, Mesh]) -> None:
    for name in ("Tray", "Bowl", "Pearls"):
        mesh = meshes[name]
        welded = trimesh.Trimesh(np.round(mesh.positions.astype(np.float64), 7), mesh.faces)
        welded.merge_vertices(merge_norm=True, merge_tex=True)
        assert welded.is_watertight, name
        assert welded.is_winding_consistent, name
        assert welded.volume > 0, name


def test_the_teapot_has_thirty_two_patches_of_newells_size() -> None:
    control = [points for _, points in patches()]
    assert len(control) == 32
    box = np.concatenate([tessellate(points, 24).positions for points in control])
    np.testing.assert_allclose(box.min(0), [-3, -2, 0], atol=2e-3)
    np.testing.assert_allclose(box.max(0), [3.434, 2, 3.15], atol=2e-3)


def test_the_teapots_patches_meet() -> None:
    edges = [tessellate(points, 8).positions.reshape(9, 9, 3) for _, points in patches()]
    borders = [np.concatenate([e[0], e[-1], e[:, 0], e[:, -1]]) for e in edges]
    distance, _ = cKDTree(np.concatenate(borders)).query(np.concatenate(borders[4:12]), k=2)
    assert distance[:, 1].max() < 1e-12  # every border point of the body's patches has a counterpart


def test_the_teapot_is_newells(shared_data: Path) -> None:
    lines = (shared_data / "scenes" / "meshes" / "teapot_alec.obj").read_text().splitlines()
    reference = np.array([line.split()[1:4] for line in lines if line.startswith("v ")], float)
    ours = np.concatenate([tessellate(points, 60).positions for _, points in patches()])
    distance, _ = cKDTree(ours * (1, -1, 1)).query(reference[:, [0, 2, 1]])
    assert distance.max() < 1e-5


def test_objects_stand_on_their_support(meshes: dict[str, Mesh]) -> None:
    pot = teapot(14, still_life.TEAPOT_HEIGHT)
    assert pot.positions[:, 1].min() == pytest.approx(0, abs=1e-12)
    floor = meshes["Tray"].positions
    inside = np.abs(floor[:, [0, 2]]).max(1) < 0.05
    tray_floor = floor[inside & (floor[:, 1] > 0.005)][:, 1].max()
    for name in ("Teapot", "Bowl"):
        assert 0 < meshes[name].positions[:, 1].min() - tray_floor < 1e-4, name
    assert meshes["Table"].positions[:, 1].min() >= 0
    assert 0 < meshes["Cloth"].positions[:, 1].min() < 2e-3


def test_pearls_touch_the_ground_but_not_each_other(meshes: dict[str, Mesh]) -> None:
    balls = _balls(meshes["Pearls"])
    assert len(balls) > 50
    centres, radii = np.array([c for c, _ in balls]), np.array([r for _, r in balls])
    gaps = np.linalg.norm(centres[:, None] - centres[None], axis=2) - radii[:, None] - radii[None]
    assert gaps[~np.eye(len(balls), dtype=bool)].min() > 0
    lowest = centres[:, 1] - radii
    ground = still_life.ground_height(centres[:, 0], centres[:, 2])
    assert (lowest >= ground - 1e-6).all()


def test_nothing_reaches_into_a_pearl(meshes: dict[str, Mesh]) -> None:
    balls = _balls(meshes["Pearls"])
    for name in ("Teapot", "Tray", "Handles", "Bowl", "Cloth", "Table"):
        distance, _ = cKDTree(meshes[name].positions).query([center for center, _ in balls])
        assert (distance - [radius for _, radius in balls]).min() > -2e-4, name


def test_the_teapot_touches_neither_bowl_nor_pearls(meshes: dict[str, Mesh]) -> None:
    pot = cKDTree(meshes["Teapot"].positions)
    for name in ("Bowl", "Pearls"):
        distance, _ = pot.query(meshes[name].positions)
        assert distance.min() > 0.002, name


def _balls(mesh: Mesh) -> list[tuple[np.ndarray, float]]:
    parts = trimesh.Trimesh(mesh.positions, mesh.faces).split(only_watertight=False)
    return [(p.vertices.mean(0), float(np.linalg.norm(p.vertices - p.vertices.mean(0), axis=1).max())) for p in parts]


def test_terms_name_models_parameters_and_textures_that_exist(scene: Scene) -> None:
    for material in scene.materials:
        for term in material.terms:
            declared = TERMS[term["model"]]
            for name, value in term.get("params", {}).items():
                values, parameter = np.atleast_1d(value), declared.parameter(name)
                assert parameter.minimum <= values.min() <= values.max() <= parameter.maximum
            if term.get("texture") is not None:
                assert term["texture"] in material.textures


def test_the_scene_uses_five_models(scene: Scene) -> None:
    shown = {term["model"] for material in scene.materials for term in material.terms}
    assert shown == {"lambert", "ggx", "cook_torrance", "ashikhmin_shirley", "blinn_phong"}


def test_the_studio_has_a_large_key_and_a_small_light(scene: Scene) -> None:
    radiance = scene.environment.radiance.mean(-1).astype(np.float64)
    power = radiance * texel_solid_angles(*radiance.shape)[:, None]
    is_bright = radiance > 100
    key = (radiance > 5) & ~is_bright
    solid_angle = np.broadcast_to(texel_solid_angles(*radiance.shape)[:, None], radiance.shape)
    assert solid_angle[is_bright].sum() < 0.01
    assert solid_angle[key].sum() > 0.15
    assert 0.1 < power[is_bright].sum() / power[key].sum() < 1.5
    assert (texel_directions(*radiance.shape)[is_bright | key][:, 1] > 0).all()


def test_the_views_show_the_still_life(scene: Scene, meshes: dict[str, Mesh]) -> None:
    assert [camera.name for camera in scene.cameras] == ["front", "left"]
    for camera in scene.cameras:
        local = (meshes["Teapot"].positions - camera.to_world[:3, 3]) @ camera.to_world[:3, :3]
        half_height = np.tan(camera.yfov / 2)
        x, y = -local[:, 0] / local[:, 2] / (half_height * 4 / 3), -local[:, 1] / local[:, 2] / half_height
        assert max(np.abs(x).max(), np.abs(y).max()) < 0.95
        assert np.ptp(y) > 0.6  # large in the image
