"""Scenes of a few hundred triangles made by code, for tests of the numerics."""

from __future__ import annotations

import numpy as np

from relume.assets.environments.environment import Environment
from relume.assets.environments.equirect import texel_directions
from relume.lights.shape_triangles import LightTriangles
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import any_tangent
from relume.scene.model import Camera, Material, Mesh, Scene, Texture
from relume.scene.scene_folder import make_scene


def make_surface_points(position, normal, first=0):
    """Points with arbitrary tangents; the first has this seed."""
    position, normal = (np.ascontiguousarray(a, np.float32) for a in (position, normal))
    return SurfacePoints(
        position, normal, any_tangent(normal), np.arange(first, first + len(position), dtype=np.uint32)
    )


def mesh(name, positions, faces, material, normals=None, tangents=None, uvs=None):
    """A mesh from lists; without normals, all have that of the first face."""
    positions, faces = np.asarray(positions, np.float32), np.asarray(faces, np.uint32)
    if normals is None:
        a, b, c = positions[faces[0]]
        normal = np.cross(b - a, c - a)
        normals = np.tile(normal / np.linalg.norm(normal), (len(positions), 1))
    tangents = np.zeros((len(positions), 4)) if tangents is None else tangents
    uvs = np.zeros((len(positions), 2)) if uvs is None else uvs
    floats = (np.ascontiguousarray(a, np.float32) for a in (positions, normals, tangents, uvs))
    return Mesh(name, *floats, faces, material)


def quad(name, corners, material, tangent=(1, 0, 0)):
    """A rectangle, counter-clockwise from its front, with the unit square as UV coordinates."""
    uvs = [[0, 1], [1, 1], [1, 0], [0, 0]]
    return mesh(name, corners, [[0, 1, 2], [0, 2, 3]], material, tangents=np.tile([*tangent, 1.0], (4, 1)), uvs=uvs)


def sphere(name, center, radius, material, num_rings=12, inside=False):
    """A ball of about 4 · rings² triangles with smooth normals; `inside`: its front faces inward."""
    theta, phi = np.linspace(0, np.pi, num_rings + 1), np.linspace(0, 2 * np.pi, 2 * num_rings + 1)
    theta, phi = (grid.ravel() for grid in np.meshgrid(theta, phi, indexing="ij"))
    normals = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=1)
    tangents = np.stack([-np.sin(phi), 0 * phi, np.cos(phi), 1 + 0 * phi], axis=1)
    uvs = np.stack([phi / (2 * np.pi), theta / np.pi], axis=1)
    faces = []
    for ring in range(num_rings):
        for k in range(2 * num_rings):
            a = ring * (2 * num_rings + 1) + k
            b = a + 2 * num_rings + 1
            faces += [[a, a + 1, b]] if ring > 0 else []
            faces += [[a + 1, b + 1, b]] if ring < num_rings - 1 else []
    positions = np.asarray(center) + radius * normals
    faces = np.asarray(faces)
    if inside:
        normals, faces = -normals, faces[:, ::-1]
    return mesh(name, positions, faces, material, normals, tangents, uvs)


def torus(name, radius, tube, material, num_steps=192, num_tube_steps=24, tilt=0.5):
    """A ring around the origin with smooth normals, its axis tilted from +Y toward the camera on +Z, in radians."""
    u, v = np.linspace(0, 2 * np.pi, num_steps + 1), np.linspace(0, 2 * np.pi, num_tube_steps + 1)
    u, v = (grid.ravel() for grid in np.meshgrid(u, v, indexing="ij"))
    normals = np.stack([np.cos(u) * np.cos(v), np.sin(v), np.sin(u) * np.cos(v)], axis=1)
    positions = radius * np.stack([np.cos(u), 0 * u, np.sin(u)], axis=1) + tube * normals
    cos, sin = np.cos(tilt), np.sin(tilt)
    rotation = np.array([[1, 0, 0], [0, cos, sin], [0, -sin, cos]])
    a = (np.arange(num_steps)[:, None] * (num_tube_steps + 1) + np.arange(num_tube_steps)).ravel()
    b = a + num_tube_steps + 1
    faces = np.concatenate([np.stack([a, a + 1, b], axis=1), np.stack([a + 1, b + 1, b], axis=1)])
    return mesh(name, positions @ rotation, faces, material, normals @ rotation)


def make_emissive_triangles(corners, is_two_sided):
    """Uniformly emissive triangles. corners: (T, 3, 3)"""
    return LightTriangles(np.asarray(corners, np.float32), np.ones(len(corners), np.float32), is_two_sided)


def make_camera(name, origin, target, yfov):
    """An upright camera at `origin` with `target` at the image center."""
    origin, target = np.asarray(origin, float), np.asarray(target, float)
    back = (origin - target) / np.linalg.norm(origin - target)
    right = np.cross([0, 1, 0], back)
    right /= np.linalg.norm(right)
    to_world = np.eye(4)
    to_world[:3, :3] = np.stack([right, np.cross(back, right), back], axis=1)
    to_world[:3, 3] = origin
    return Camera(name, to_world, yfov)


def studio(height=32, key=60.0):
    """A dim, colored environment with a warm softbox and a small cold spot."""
    d = texel_directions(height, 2 * height).astype(float)
    ambient = 0.3 + 0.2 * d[..., 1:2] * [0.5, 0.8, 1.0] + 0.1 * d[..., :1] * [1.0, 0.2, -0.6]

    def spot(towards, width):
        towards = np.asarray(towards) / np.linalg.norm(towards)
        return np.exp((d @ towards - 1) / width**2)[..., None]

    light = (
        ambient + key * spot([-1, 1.5, 1], 0.15) * [1, 0.9, 0.7] + 0.5 * key * spot([2, 1, 0.3], 0.06) * [0.5, 0.7, 1]
    )
    return np.maximum(light, 0).astype(np.float32)


def checker(size=16, num_squares=8):
    """A texture of black and white squares."""
    row = np.arange(size) * num_squares // size
    on = (row[:, None] + row) % 2
    return Texture(np.repeat(on[..., None], 3, axis=2).astype(np.float32))


def corner(materials):
    """A floor and a ball on it of the first material, before a wall of the second, under a small bright light."""
    meshes = [
        quad("floor", [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], 0),
        quad("wall", [[-1, 0, -1], [1, 0, -1], [1, 1, -1], [-1, 1, -1]], 1),
        sphere("ball", [0.2, 0.3, 0.1], 0.3, 0, num_rings=8),
    ]
    radiance = np.full((16, 32, 3), 0.3, np.float32)
    radiance[2:5, 14:18] = 30
    camera = make_camera("front", (0.6, 1.2, 2.4), (0, 0.2, 0), 0.7)
    return make_tiny_scene(*meshes, camera=camera, environment=radiance, materials=materials)


def still_life():
    """A ball and a wall on a checkered floor, two views, every BRDF model in use."""
    terms = {
        "Floor": (
            {"model": "lambert", "color": [0.6, 0.5, 0.4], "texture": "diffuse"},
            {"model": "ggx", "color": [0.8, 0.8, 0.8], "params": {"roughness": 0.4}},
        ),
        "Wall": (
            {"model": "ashikhmin_shirley", "color": [0.7, 0.9, 1.0]},
            {"model": "blinn_phong", "color": [0.3, 0.3, 0.2], "params": {"exponent": 30.0}},
        ),
        "Ball": (
            {"model": "lambert", "color": [0.3, 0.05, 0.05]},
            {"model": "cook_torrance", "color": [0.9, 0.8, 0.7], "params": {"sigma": 0.2, "ior": 1.8}},
        ),
    }
    textures = {"Floor": {"diffuse": checker()}}
    materials = [Material(name, brdf_terms, textures.get(name, {})) for name, brdf_terms in terms.items()]
    meshes = [
        quad("floor", [[-2, 0, 2], [2, 0, 2], [2, 0, -2], [-2, 0, -2]], 0),
        quad("wall", [[-2, 0, -1], [2, 0, -1], [2, 1.2, -1], [-2, 1.2, -1]], 1),
        sphere("ball", [0.1, 0.5, 0], 0.5, 2, num_rings=10),
    ]
    cameras = [
        make_camera("front", [0.3, 1.1, 3], [0, 0.45, 0], 0.8),
        make_camera("left", [-2.5, 1.5, 1.5], [0, 0.4, 0], 0.7),
    ]
    return make_scene("still life", meshes, materials, cameras, Environment("studio", studio()))


def make_tiny_scene(*meshes, camera, environment=None, materials=None, lights=()) -> Scene:
    """A scene of some meshes and one camera; by default with white Lambert materials."""
    if materials is None:
        count = 1 + max(m.material for m in meshes)
        materials = [Material(f"M{k}", ({"model": "lambert", "color": [1, 1, 1]},)) for k in range(count)]
    radiance = np.ones((4, 8, 3), np.float32) if environment is None else environment
    return make_scene("tiny", meshes, materials, [camera], Environment("environment", radiance), lights=lights)
