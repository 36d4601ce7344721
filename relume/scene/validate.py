"""Validation of scenes before they are traced or saved, for importers and the scene folder."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relume.assets.environments.environment import Environment
from relume.core.errors import ParameterError, SceneError
from relume.scene.lens import make_lens
from relume.scene.light_members import MAX_MEMBERS
from relume.scene.model import WRAPS, Camera, Light, Material, Mesh

MAX_TRIANGLES = 20_000_000
MAX_MATERIALS = 1_000
MAX_LIGHTS, MAX_LIGHT_NAME = 64, 80
ENVIRONMENT = "environment"
"""Name of the environment among the sources of light; no light has it."""
MAX_IOR = 4.0
# of lights, in a scene and in a look: 1000 W are as bright in a scene of 100 km as 0.1 W in a room
MAX_EMISSION, MAX_METERS = 1e12, 1e9
MAX_SUN_ANGLE = 30.0  # diameter of the disk of a directional light, degrees
RADIUS_RANGE = (1e-4, 1e4)  # of discs, spheres and tubes, and lengths of tubes; meters


def check_mesh(mesh: Mesh, num_materials: int) -> None:
    """Raise SceneError if array shapes do not match, an index is out of range or a value is not finite."""
    num_vertices = len(mesh.positions)
    widths = {"positions": 3, "normals": 3, "tangents": 4, "uvs": 2}
    for name, width in widths.items():
        array = getattr(mesh, name)
        if array.shape != (num_vertices, width) or array.dtype != np.float32:
            raise SceneError(f"{name} of mesh {mesh.name!r} have the wrong shape or type; export the scene again")
        if not np.isfinite(array).all():
            raise SceneError(f"{name} of mesh {mesh.name!r} contain NaN or infinity; repair and export the mesh again")
    if mesh.faces.ndim != 2 or mesh.faces.shape[1] != 3 or mesh.faces.dtype != np.uint32:
        raise SceneError(f"faces of mesh {mesh.name!r} have the wrong shape or type; export the scene again")
    if len(mesh.faces) == 0 or int(mesh.faces.max()) >= num_vertices:
        raise SceneError(f"mesh {mesh.name!r} has no triangles or indices out of range; export it again")
    if not 0 <= mesh.material < num_materials:
        raise SceneError(f"mesh {mesh.name!r} uses material {mesh.material}, which does not exist; export it again")


def check_opacity(material: Material) -> None:
    """Raise SceneError if the alpha texture is invalid or the cutoff is out of range."""
    opacity = material.opacity
    if opacity is None:
        return
    is_image = opacity.alpha.ndim == 2 and opacity.alpha.size > 0 and opacity.alpha.dtype == np.uint8
    if not is_image or not set(opacity.wrap) <= set(WRAPS):
        raise SceneError(f"the alpha texture of material {material.name!r} is invalid; import the scene again")
    if opacity.cutoff is not None and not 0 < opacity.cutoff <= 1:
        raise SceneError(f"alphaCutoff of material {material.name!r} is {opacity.cutoff}; set it above 0 and at most 1")


def check_glass(material: Material) -> None:
    """Raise SceneError if a parameter of the glass is out of range."""
    glass = material.glass
    if glass is None:
        return
    are_fractions_valid = all(0 <= fraction <= 1 for fraction in glass.tint) and all(
        0 <= rate < np.inf for rate in glass.absorbed
    )
    are_sizes_valid = 1 <= glass.ior <= MAX_IOR and 0 <= glass.thickness <= MAX_METERS and 0 <= glass.roughness <= 1
    if not (are_fractions_valid and are_sizes_valid and len(glass.tint) == len(glass.absorbed) == 3):
        raise SceneError(f"the glass parameters of material {material.name!r} are out of range; import the scene again")


def check_maps(material: Material) -> None:
    """Raise SceneError if the encoding of a texture does not suit its channel, or its scale is invalid."""
    for channel, texture in material.textures.items():
        kind = None if texture.encoding is None else texture.encoding.kind
        fits = kind == "share" if channel == "roughness" else kind in ("srgb", None)
        scale = (1.0,) if texture.encoding is None else texture.encoding.scale
        if not fits or not all(0 <= value < np.inf for value in scale):
            raise SceneError(
                f"the {channel} texture of material {material.name!r} has an invalid encoding; import the scene again"
            )


def check_camera(camera: Camera) -> None:
    """Raise SceneError unless the frame is rigid and finite, and field of view and near plane are possible."""
    to_world = camera.to_world
    if to_world.shape != (4, 4) or not np.isfinite(to_world).all() or not 0 < camera.yfov < np.pi:
        raise SceneError(f"camera {camera.name!r} has an invalid position or field of view; set them")
    if not 0 <= camera.near < np.inf:
        raise SceneError(f"camera {camera.name!r} has an invalid near plane; set it to 0 or more meters")
    if camera.lens is not None:
        try:
            make_lens(**vars(camera.lens))
        except ParameterError as error:
            raise SceneError(f"camera {camera.name!r} has an invalid lens: {error}") from error
    if not np.allclose(to_world[:3, :3] @ to_world[:3, :3].T, np.eye(3), atol=1e-4):
        raise SceneError(f"camera {camera.name!r} has scale or shear in its transform; remove them")


def check_environment(environment: Environment) -> None:
    """Raise SceneError unless the radiance is (height, width, 3) float32, finite and not negative."""
    radiance = environment.radiance
    if radiance.ndim != 3 or radiance.shape[2] != 3 or radiance.size == 0 or radiance.dtype != np.float32:
        raise SceneError(f"environment {environment.name!r} is not an RGB float image; convert it to .hdr or .exr")
    if not np.isfinite(radiance).all() or float(radiance.min()) < 0:
        raise SceneError(f"environment {environment.name!r} has negative or non-finite texels; repair the image")


def check_lights(lights: Sequence[Light]) -> None:
    """Raise SceneError if there are too many lights, or a name is unsuitable for a look."""
    if len(lights) > MAX_LIGHTS:
        raise SceneError(
            f"the scene has {len(lights):,} lights, the limit is {MAX_LIGHTS}; remove the least important ones"
        )
    if sum(len(light.members.position) for light in lights if light.members is not None) > MAX_MEMBERS:
        raise SceneError(f"the sources of the scene have more than {MAX_MEMBERS:,} lights; remove the least important")
    names = [light.name for light in lights]
    if len(set(names)) != len(names) or not all(1 <= len(name) <= MAX_LIGHT_NAME for name in names):
        raise SceneError(f"the names of lights must be unique and have 1 to {MAX_LIGHT_NAME} characters; rename them")
    if ENVIRONMENT in names:
        raise SceneError(f"a light is named {ENVIRONMENT!r}, as the environment is; rename it")


def check_scene(
    meshes: Sequence[Mesh],
    materials: Sequence[Material],
    cameras: Sequence[Camera],
    environment: Environment,
    lights: Sequence[Light],
) -> None:
    """Validate a scene.

    Args:
        meshes: shapes, indices and values; at most `MAX_TRIANGLES` in total.
        materials: unique names, textures, opacity and glass.
        cameras: unique names, rigid frames.
        environment: size and values.
        lights: number and names; `relume.look` validates their fields.
    Raises:
        SceneError: something is invalid; the message says what to do.
    """
    if not meshes:
        raise SceneError("the scene has no triangles with an area; export at least one mesh made of triangles")
    if not cameras:
        raise SceneError("the scene has no camera; add one")
    if len(materials) > MAX_MATERIALS:
        raise SceneError(f"the scene has {len(materials):,} materials, the limit is {MAX_MATERIALS:,}; merge some")
    num_triangles = sum(len(mesh.faces) for mesh in meshes)
    if num_triangles > MAX_TRIANGLES:
        raise SceneError(f"the scene has {num_triangles:,} triangles, the limit is {MAX_TRIANGLES:,}; simplify it")
    for kind, names in (("materials", [m.name for m in materials]), ("cameras", [c.name for c in cameras])):
        if len(set(names)) != len(names) or not all(names):
            raise SceneError(f"the names of the {kind} are empty or not unique; rename them")
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
