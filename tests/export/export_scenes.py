"""Small scenes for exports: a textured quad, glass, coat, sheen, lights and cameras."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from tiny_scenes import quad

from relume.assets.environments.environment import Environment
from relume.export.export_document import ExportDocument, look_of_scene, prepare_export
from relume.scene.model import Camera, Glass, Light, Material, Opacity, Scene, Texture, TextureEncoding
from relume.scene.scene_folder import make_scene
from relume.scene_io.surfaces.to_terms import CoatLayer, PbrSurface, make_terms

PLASTIC = PbrSurface(np.array([0.5, 0.3, 0.1]), np.full(3, 0.04), 1.0, 0.4, 0.043537)
METAL = PbrSurface(np.zeros(3), np.array([0.9, 0.7, 0.3]), 1.0, 0.3)


def terms_of(surface: PbrSurface, coat: CoatLayer | None = None) -> tuple[dict[str, Any], ...]:
    return make_terms(surface, coat or CoatLayer())


def checker(colors: Any, size: int = 4) -> NDArray[np.uint8]:
    """An image of two colors. (size, size, channels)"""
    rows, columns = np.indices((size, size))
    return np.asarray(colors, np.uint8)[(rows + columns) % 2]


def srgb_texture(pixels: Any, scale: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Texture:
    return Texture(np.asarray(pixels, np.uint8), ("mirror", "clamp"), TextureEncoding("srgb", scale))


def scene_of(*materials: Material, lights: tuple[Light, ...] = (), **fields: Any) -> Scene:
    """One quad for each material, side by side, before a camera."""
    meshes = [
        quad(material.name, [[k, 0, 0], [k + 1, 0, 0], [k + 1, 1, 0], [k, 1, 0]], k)
        for k, material in enumerate(materials)
    ]
    to_world = np.eye(4)
    to_world[:3, 3] = [len(materials) / 2, 0.5, 3]
    environment = Environment("gray", np.ones((4, 8, 3), np.float32))
    camera = Camera("front", to_world, 0.7, 1.5, 0.1)
    return make_scene("Quads", meshes, list(materials), [camera], environment, lights=lights, **fields)


def export_of(scene: Scene, look: dict[str, Any] | None = None, **variants: dict[str, Any]) -> ExportDocument:
    looks = {name: look_of_scene(scene, document, name) for name, document in variants.items()}
    return prepare_export(scene, look_of_scene(scene, look or {}, "look"), looks)


def sample_scene() -> Scene:
    """Glass, coat, sheen, textures, opacity, emission and all kinds of lights."""
    roughness = Texture(checker([[51], [153]]), ("mirror", "clamp"), TextureEncoding("share", (2.5, 2.5, 2.5)))
    normals = Texture(checker([[128, 128, 255], [150, 128, 250]]), encoding=TextureEncoding("normal", (0.5, 0.5, 1.0)))
    textures = {"diffuse": srgb_texture(checker([[255, 0, 0], [0, 200, 40]])), "roughness": roughness}
    textured = PbrSurface(
        PLASTIC.diffuse, PLASTIC.f0, 1.0, 0.4, PLASTIC.specular_reflectance, textures, has_normal_map=True
    )
    glass = Glass((0.9, 0.8, 0.7), 1.3, 0.01, (1.0, 2.0, 4.0), 0.2)
    glass_surface = PbrSurface(np.zeros(3), np.full(3, (0.3 / 2.3) ** 2), 1.0, 0.2)
    return scene_of(
        Material("Textured", terms_of(textured), textures, normals),
        Material("Metal", terms_of(METAL)),
        Material("Lacquer", terms_of(PLASTIC, CoatLayer(coat=0.8, coat_roughness=0.1))),
        Material("Felt", terms_of(PLASTIC, CoatLayer(sheen=(0.3, 0.2, 0.1), sheen_roughness=0.5))),
        Material("Pane", terms_of(glass_surface), glass=glass),
        Material("Leaf", terms_of(PLASTIC), opacity=Opacity(checker([255, 0]), cutoff=0.5)),
        Material("Bulb", terms_of(PLASTIC)),
        lights=(
            Light("Bulb", {"kind": "mesh", "material": "Bulb", "emission": [4.0, 2.0, 1.0]}),
            Light("Point", {"kind": "point", "position": [0.0, 2.0, 1.0], "emission": [3.0, 2.0, 1.0]}),
            Light(
                "Spot",
                {
                    "kind": "spot",
                    "position": [1.0, 2.0, 1.0],
                    "direction": [0.0, -0.8, -0.6],
                    "cone": [10.0, 25.0],
                    "emission": [5.0, 5.0, 5.0],
                },
            ),
            Light("Sun", {"kind": "directional", "direction": [0.6, -0.8, 0.0], "emission": [1.0, 1.0, 0.5]}),
        ),
    )
