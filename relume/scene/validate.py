"""What every scene must satisfy before anything is traced; importers and the archive both end here."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relume.assets.environments.environment import Environment
from relume.core.errors import SceneError
from relume.scene.model import WRAPS, Camera, Light, Material, Mesh

MAX_TRIANGLES = 20_000_000
MAX_MATERIALS = 1_000
MAX_LIGHTS, MAX_LIGHT_NAME = 64, 80
MAX_IOR = 4.0
MAX_EMISSION, MAX_METERS = 1e6, 1e6  # of lights, in a scene and in a look


def check_mesh(mesh: Mesh, num_materials: int) -> None:
    """Raises SceneError where shapes do not fit, an index is out of range or a value is not finite."""
    num_vertices = len(mesh.positions)
    widths = {"positions": 3, "normals": 3, "tangents": 4, "uvs": 2}
    for name, width in widths.items():
        array = getattr(mesh, name)
        if array.shape != (num_vertices, width) or array.dtype != np.float32:
            raise SceneError(f"{name} of mesh {mesh.name!r} have the wrong shape or type; export the scene again")
        if not np.isfinite(array).all():
            raise SceneError(f"{name} of mesh {mesh.name!r} are not all finite; repair the mesh and export it again")
    if mesh.faces.ndim != 2 or mesh.faces.shape[1] != 3 or mesh.faces.dtype != np.uint32:
        raise SceneError(f"faces of mesh {mesh.name!r} have the wrong shape or type; export the scene again")
    if len(mesh.faces) == 0 or int(mesh.faces.max()) >= num_vertices:
        raise SceneError(f"mesh {mesh.name!r} has no triangles or indexes vertices it has not; export it again")
    if not 0 <= mesh.material < num_materials:
        raise SceneError(f"mesh {mesh.name!r} names material {mesh.material}, which there is not; export it again")


def check_opacity(material: Material) -> None:
    """Raises SceneError where opacity is not an image of bytes, or cuts at no share."""
    opacity = material.opacity
    if opacity is None:
        return
    is_image = opacity.alpha.ndim == 2 and opacity.alpha.size > 0 and opacity.alpha.dtype == np.uint8
    if not is_image or not set(opacity.wrap) <= set(WRAPS):
        raise SceneError(f"the opacity of material {material.name!r} is not an image of bytes; import the scene again")
    if opacity.cutoff is not None and not 0 < opacity.cutoff <= 1:
        raise SceneError(f"material {material.name!r} is cut at {opacity.cutoff}; give a share above 0, at most 1")


def check_glass(material: Material) -> None:
    """Raises SceneError where glass is of numbers that none has."""
    glass = material.glass
    if glass is None:
        return
    are_fractions_valid = all(0 <= fraction <= 1 for fraction in glass.tint) and all(
        0 <= rate < np.inf for rate in glass.absorbed
    )
    are_sizes_valid = 1 <= glass.ior <= MAX_IOR and 0 <= glass.thickness <= MAX_METERS
    if not (are_fractions_valid and are_sizes_valid and len(glass.tint) == len(glass.absorbed) == 3):
        raise SceneError(f"the glass of material {material.name!r} is out of range; import the scene again")


def check_maps(material: Material) -> None:
    """Raises SceneError where a texture is not of bytes that its channel stands for, or its scale is no number."""
    for channel, texture in material.textures.items():
        kind = None if texture.encoding is None else texture.encoding.kind
        fits = kind == "share" if channel == "roughness" else kind in ("srgb", None)
        scale = (1.0,) if texture.encoding is None else texture.encoding.scale
        if not fits or not all(0 <= value < np.inf for value in scale):
            raise SceneError(
                f"the {channel} texture of material {material.name!r} is of no use; import the scene again"
            )


def check_camera(camera: Camera) -> None:
    """Raises SceneError unless the frame is rigid and finite and the field of view lies between 0 and 180°."""
    to_world = camera.to_world
    if to_world.shape != (4, 4) or not np.isfinite(to_world).all() or not 0 < camera.yfov < np.pi:
        raise SceneError(f"camera {camera.name!r} has no usable position or field of view; set them")
    if not np.allclose(to_world[:3, :3] @ to_world[:3, :3].T, np.eye(3), atol=1e-4):
        raise SceneError(f"camera {camera.name!r} is not a rigid frame; remove its scale and shear")


def check_environment(environment: Environment) -> None:
    """Raises SceneError unless the radiance is (height, width, 3) float32, finite and not negative."""
    radiance = environment.radiance
    if radiance.ndim != 3 or radiance.shape[2] != 3 or radiance.size == 0 or radiance.dtype != np.float32:
        raise SceneError(f"environment {environment.name!r} is not an RGB float image; convert it to .hdr or .exr")
    if not np.isfinite(radiance).all() or float(radiance.min()) < 0:
        raise SceneError(f"environment {environment.name!r} holds texels that are no light; repair the image")


def check_lights(lights: Sequence[Light]) -> None:
    """Raises SceneError where there are too many, or one has no name that a look can use."""
    if len(lights) > MAX_LIGHTS:
        raise SceneError(
            f"the scene has {len(lights):,} lights, {MAX_LIGHTS} are allowed; remove those that matter least"
        )
    names = [light.name for light in lights]
    if len(set(names)) != len(names) or not all(1 <= len(name) <= MAX_LIGHT_NAME for name in names):
        raise SceneError(f"the lights need names of 1 to {MAX_LIGHT_NAME} characters, each its own; rename them")


def check_scene(
    meshes: Sequence[Mesh],
    materials: Sequence[Material],
    cameras: Sequence[Camera],
    environment: Environment,
    lights: Sequence[Light],
) -> None:
    """Refuses parts that do not make a scene.

    Args:
        meshes: their shapes, indices and values are checked, and that they have at most `MAX_TRIANGLES` together.
        materials: checked to have names of their own, textures that fit, opacity that is an image, and glass that bends
            and dims.
        cameras: checked to be rigid and to have names of their own.
        environment: its size and values are checked.
        lights: their number and names are checked; their fields are the look's to check.
    Raises:
        SceneError: something does not fit; it says what to do.
    """
    if not meshes:
        raise SceneError("the scene has no triangles with an area; export at least one mesh made of triangles")
    if not cameras:
        raise SceneError("the scene has no camera; add one")
    if len(materials) > MAX_MATERIALS:
        raise SceneError(f"the scene has {len(materials):,} materials, {MAX_MATERIALS:,} are allowed; merge some")
    num_triangles = sum(len(mesh.faces) for mesh in meshes)
    if num_triangles > MAX_TRIANGLES:
        raise SceneError(f"the scene has {num_triangles:,} triangles, {MAX_TRIANGLES:,} are allowed; simplify it")
    for kind, names in (("materials", [m.name for m in materials]), ("cameras", [c.name for c in cameras])):
        if len(set(names)) != len(names) or not all(names):
            raise SceneError(f"the names of the {kind} are empty or not unique; give each its own")
    for mesh in meshes:
        check_mesh(mesh, len(materials))
    for material in materials:
        check_maps(material)
        check_opacity(material)
        check_glass(material)
    for camera in cameras:
        check_camera(camera)
    check_environment(environment)
    check_lights(lights)
