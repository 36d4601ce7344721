"""UsdLux lights as local lights and as an environment.

Radiance is L = color · blackbody · intensity · 2^exposure, over the area of the light if it is normalized. Kinds that
relume does not have become the nearest one with the same power in its main direction.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.environments.environment import Environment
from relume.assets.environments.equirect import lookup, texel_directions
from relume.assets.environments.read_environment import read_environment
from relume.assets.ies.ies_file import IesFile
from relume.assets.ies.ies_store import IES_FILES
from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, ignored, quote, unsupported
from relume.scene.collect_lights import LightCollector
from relume.scene.validate import MAX_METERS, MAX_SUN_ANGLE, RADIUS_RANGE
from relume.scene_io.surfaces.surface_images import ImageInput, SurfaceImages
from relume.scene_io.usd.ies_profiles import profile_rotation, read_profile
from relume.scene_io.usd.light_links import read_links

F64 = NDArray[np.float64]
F32 = NDArray[np.float32]
MAX_INTENSITY = 1e30
_MAX_RADIANCE = 1e6  # of domes
UNIFORM_SIZE = (2, 4)  # texels of a dome without an image
_BLENDER_VERSION = re.compile(r"Blender v(\d{1,4})\.")
_BLENDER_SUN, _BLENDER_REASON = 4.0, "Blender writes a quarter"
DOMES = ("DomeLight", "DomeLight_1")
_SHAPED = ("SphereLight", "DiskLight", "CylinderLight")  # which may have a cone or an IES file
KINDS = ("DistantLight", "SphereLight", "DiskLight", "RectLight", "CylinderLight", *DOMES)


def radiance(prim: Any, time: Any) -> Shaped[F64, " 3"]:
    """L of a light before normalization."""
    from pxr import UsdLux

    light = UsdLux.LightAPI(prim)
    color = np.asarray(light.GetColorAttr().Get(time), np.float64)
    if light.GetEnableColorTemperatureAttr().Get(time):
        kelvin = float(light.GetColorTemperatureAttr().Get(time))
        color = color * np.asarray(UsdLux.BlackbodyTemperatureAsRgb(kelvin))
    exposure = float(np.clip(light.GetExposureAttr().Get(time), -100, 100))
    emitted = color * light.GetIntensityAttr().Get(time) * 2**exposure
    return np.asarray(np.nan_to_num(np.clip(emitted, 0, MAX_INTENSITY)), np.float64)


class UsdLightReader:
    """Reads the lights of one stage.

    Args:
        time, meters, images, collector, warnings: of the stage.
        objects: name of each object of the scene by the path of its prim, see `read_links`.
    Attributes:
        environment: light of the first dome; None without one. ies_files: of all lights, by name in looks.
    """

    def __init__(
        self,
        time: Any,
        meters: float,
        images: SurfaceImages,
        collector: LightCollector,
        warnings: list[ImporterWarning],
        objects: Mapping[str, str],
    ) -> None:
        self._time, self._meters, self._images, self._objects = time, meters, images, objects
        self._collector, self._warnings = collector, warnings
        self.environment: Environment | None = None
        self.ies_files: dict[str, IesFile] = {}

    def add(self, prim: Any, to_world: Shaped[F64, "4 4"]) -> None:
        """Add a light with its links; it emits along the −Z of its prim.

        Args:
            prim: a light of `KINDS`. to_world: from its space to meters.
        Raises:
            SceneError: there are more lights than a look can have.
        """
        lights, label = self._collector.lights, f"light {quote(prim.GetName())}"
        first = len(lights)
        self._add(prim, to_world, label)
        links = read_links(prim, label, self._objects, self._warnings)
        if str(prim.GetTypeName()) in DOMES and links:
            self._warnings.append(unsupported(f"{_capital(label)} lights all objects: link the environment instead."))
        lights[first:] = [replace(light, fields={**light.fields, **links}) for light in lights[first:]]

    def _add(self, prim: Any, to_world: Shaped[F64, "4 4"], label: str) -> None:
        kind = str(prim.GetTypeName())
        self._warn_unsupported(prim, label)
        if kind in DOMES:
            self._add_dome(prim, to_world, label)
            return
        scale = np.linalg.norm(to_world[:3, :3], axis=0)
        if np.abs(to_world[:3, 3]).max() > MAX_METERS or scale.min() < 1e-12:
            self._warnings.append(unsupported(f"Skipped {label}: its scale is zero or its position is out of range."))
            return
        emitted = radiance(prim, self._time)
        if not emitted.any():
            self._warnings.append(ignored(f"Skipped {label}: it emits no light."))
            return
        fields = {
            "position": to_world[:3, 3].tolist(),
            "direction": (-to_world[:3, 2] / scale[2]).tolist(),
        }
        if kind == "DistantLight":
            self._add_distant(prim, fields, emitted, label)
        elif kind in ("RectLight", "DiskLight"):
            self._add_flat(prim, kind, fields, emitted, to_world, scale, label)
        else:
            self._add_round(prim, kind, fields, emitted, to_world, scale, label)

    def _number(self, prim: Any, name: str) -> float:
        value = prim.GetAttribute(f"inputs:{name}").Get(self._time)
        return float(value) if value is not None and np.isfinite(value) else 0.0

    def _is_normalized(self, prim: Any) -> bool:
        return bool(prim.GetAttribute("inputs:normalize").Get(self._time))

    def _add_distant(self, prim: Any, fields: dict[str, Any], emitted: F64, label: str) -> None:
        """Irradiance E = L π sin²(angle / 2); of a normalized light, or one without an angle, E = L."""
        half_angle = np.radians(np.clip(self._number(prim, "angle"), 0, 180)) / 2
        if half_angle > 0 and not self._is_normalized(prim):
            emitted = emitted * np.pi * np.sin(half_angle) ** 2
        if self._is_from_blender(prim):
            emitted = _BLENDER_SUN * emitted
            self._warnings.append(
                approximated(
                    f"{_capital(label)} is {_BLENDER_SUN:g} times as bright as in the file: {_BLENDER_REASON}."
                )
            )
        angle = float(np.degrees(2 * half_angle))
        if angle > MAX_SUN_ANGLE:
            self._warnings.append(
                approximated(
                    f"The angle of {label} is {MAX_SUN_ANGLE:g}°, not {angle:g}°; it is as bright as in the file."
                )
            )
        self._collector.add(
            self._collector.name(prim.GetName()),
            {"kind": "directional", "direction": fields["direction"], "angle": min(angle, MAX_SUN_ANGLE)},
            emitted,
        )

    def _is_from_blender(self, prim: Any) -> bool:
        """True if a stage is by a version of Blender that writes a quarter of a sun's irradiance."""
        version = _BLENDER_VERSION.match(prim.GetStage().GetRootLayer().documentation)
        return version is not None and int(version[1]) >= 5

    def _add_flat(
        self, prim: Any, kind: str, fields: dict[str, Any], emitted: F64, to_world: F64, scale: F64, label: str
    ) -> None:
        """A rectangle or a disc; a disk with a cone becomes a spot."""
        if kind == "RectLight":
            size = self._number(prim, "width") * scale[0], self._number(prim, "height") * scale[1]
            area = size[0] * size[1]
            shape = {"kind": "rectangle", "rotation": _rotation(to_world, scale), "size": [float(s) for s in size]}
        else:
            radius = self._number(prim, "radius") * float(np.sqrt(scale[0] * scale[1]))
            area = np.pi * radius**2
            shape = {"kind": "disc", "radius": _radius(radius)}
        if area <= 0:
            self._warnings.append(unsupported(f"Skipped {label}: it has no area."))
            return
        if self._is_normalized(prim):
            emitted = emitted / (area / self._meters**2)
        if kind == "DiskLight" and self._add_shaped(prim, fields, emitted * area, to_world, label):
            return
        if self._cone(prim) is not None:
            self._warnings.append(unsupported(f"The cone of {label} isn't supported; it emits to all of its front."))
        if kind == "DiskLight" and not np.isclose(scale[0], scale[1], rtol=1e-3):
            self._warnings.append(approximated(f"{_capital(label)} is shown as a disc of the same area."))
        emitted = emitted * self._image_mean(prim, label)
        self._collector.add(self._collector.name(prim.GetName()), {**fields, **shape}, emitted)

    def _add_round(
        self, prim: Any, kind: str, fields: dict[str, Any], emitted: F64, to_world: F64, scale: F64, label: str
    ) -> None:
        """A sphere or a tube; with a cone a spot, and a point if it is treated as one.

        The mean intensity of a sphere is L π r², that of a cylinder L π r l / 2.
        """
        radius, length = self._number(prim, "radius"), self._number(prim, "length") * scale[0]
        mean = float(np.cbrt(scale.prod()))
        if kind == "CylinderLight":
            radius *= float(np.sqrt(scale[1] * scale[2]))
            section, area = np.pi * radius * length / 2, 2 * np.pi * radius * length
        else:
            radius *= mean
            section, area = np.pi * radius**2, 4 * np.pi * radius**2
        # a normalized one has L / area · section, where area = 4 section
        intensity = emitted * self._meters**2 / 4 if self._is_normalized(prim) else emitted * section
        if area <= 0 and not self._is_normalized(prim):
            self._warnings.append(unsupported(f"Skipped {label}: it has no area."))
            return
        if self._add_shaped(prim, fields, intensity, to_world, label):
            return
        name, position = self._collector.name(prim.GetName()), {"position": fields["position"]}
        if area <= 0 or prim.GetAttribute("treatAsPoint").Get(self._time):
            self._collector.add(name, {"kind": "point", **position}, intensity)
            return
        if scale.max() > 1.001 * scale.min() and not (kind == "CylinderLight" and np.isclose(scale[1], scale[2], 1e-3)):
            self._warnings.append(approximated(f"{_capital(label)} is shown round, without its uneven scale."))
        shape: dict[str, Any] = {"kind": "sphere", "radius": _radius(radius)}
        if kind == "CylinderLight":
            axis = (to_world[:3, 0] / scale[0]).tolist()
            shape = {"kind": "tube", "direction": axis, "radius": _radius(radius), "length": _radius(length)}
        # of the power of the file also if its size is out of range
        self._collector.add(name, {**position, **shape}, intensity / _section(shape))

    def _cone(self, prim: Any) -> list[float] | None:
        """Inner and outer half-angle of the cone of UsdLuxShapingAPI, degrees; None without one."""
        angle = prim.GetAttribute("inputs:shaping:cone:angle").Get(self._time)
        if angle is None or not 0 < angle < 90:
            return None
        softness = float(np.clip(prim.GetAttribute("inputs:shaping:cone:softness").Get(self._time) or 0.0, 0, 1))
        return [float(angle) * (1 - softness), float(angle)]

    def _add_shaped(self, prim: Any, fields: dict[str, Any], intensity: F64, to_world: F64, label: str) -> bool:
        """Add a light with a cone or an IES file, as a point or a spot; False if it has neither."""
        profile = read_profile(prim, self._time, self._images.files, label, self._warnings)
        cone = self._cone(prim)
        if profile is not None:
            name = IES_FILES.name_of(profile.file.data)
            self.ies_files[name] = profile.file
            fields = {**fields, "profile": name, "rotation": profile_rotation(to_world, fields["direction"])}
            intensity = intensity * profile.factor
        if cone is not None:
            self._add_spot(prim, fields, intensity, label)
        elif profile is not None:
            self._collector.add(self._collector.name(prim.GetName()), {"kind": "point", **fields}, intensity)
        return cone is not None or profile is not None

    def _add_spot(self, prim: Any, fields: dict[str, Any], intensity: F64, label: str) -> None:
        if prim.GetAttribute("inputs:shaping:focus").Get(self._time):
            self._warnings.append(unsupported(f"The focus of {label} isn't supported; its cone is even."))
        self._collector.add(
            self._collector.name(prim.GetName()), {"kind": "spot", **fields, "cone": self._cone(prim)}, intensity
        )

    def _image_mean(self, prim: Any, label: str) -> Shaped[F64, " 3"]:
        """Mean color of a light's image; white without one."""
        path = prim.GetAttribute("inputs:texture:file").Get(self._time)
        if not path or not path.path:
            return np.ones(3)
        self._warnings.append(approximated(f"The texture of {label} was replaced by its average."))
        label = f"texture of {label}"
        if self._images.pixels(path.path, label) is None:
            return np.ones(3)
        return self._images.mean(ImageInput(path.path, is_srgb=True), label)

    def _warn_unsupported(self, prim: Any, label: str) -> None:
        from pxr import UsdLux

        if UsdLux.LightAPI(prim).GetFiltersRel().GetTargets():
            self._warnings.append(unsupported(f"Filters of {label} aren't supported."))
        ies = prim.GetAttribute("inputs:shaping:ies:file").Get(self._time)
        if ies and ies.path and str(prim.GetTypeName()) not in _SHAPED:
            self._warnings.append(unsupported(f"The IES file of {label} isn't read: points and spots can have one."))

    def _add_dome(self, prim: Any, to_world: F64, label: str) -> None:
        """The environment; of several domes, the first."""
        if self.environment is not None:
            self._warnings.append(unsupported(f"Skipped {label}: the scene has another environment."))
            return
        emitted, name = radiance(prim, self._time), prim.GetName()[:80] or "dome"
        path = prim.GetAttribute("inputs:texture:file").Get(self._time)
        data = self._images.files.read(path.path, label) if path and path.path else None
        projection = prim.GetAttribute("inputs:texture:format").Get(self._time)
        uniform = Environment(name, np.ones((*UNIFORM_SIZE, 3), np.float32))
        try:
            is_ball = projection == "mirroredBall"
            image = uniform if data is None else read_environment(data, name, is_mirror_ball=is_ball)
        except SceneError as error:
            self._warnings.append(unsupported(f"The texture of {label} was skipped: {error}."))
            image = uniform
        if projection not in (None, "automatic", "latlong", "angular", "mirroredBall"):
            self._warnings.append(
                unsupported(f"The texture of {label} is read by its shape, not as {quote(projection)}.")
            )
        pixels = image.radiance if image is uniform else _rotate(image.radiance, to_world[:3, :3] @ self._pole(prim))
        pixels = np.minimum(pixels * emitted.astype(np.float32), np.float32(_MAX_RADIANCE))
        if pixels.any():
            self.environment = Environment(name, pixels, image.warnings)
        else:
            self._warnings.append(ignored(f"Skipped {label}: it emits no light."))

    def _pole(self, prim: Any) -> Shaped[F64, "3 3"]:
        """Rotation of a dome whose image has its pole along the Z of a stage."""
        from pxr import UsdGeom

        axis = prim.GetAttribute("poleAxis").Get(self._time)
        is_z_up = UsdGeom.GetStageUpAxis(prim.GetStage()) == UsdGeom.Tokens.z
        if axis == "Z" or (axis == "scene" and is_z_up):
            return np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
        return np.eye(3)


def _rotate(pixels: Shaped[F32, "height width 3"], to_world: Shaped[F64, "3 3"]) -> Shaped[F32, "height width 3"]:
    """Rotate an image of USD, whose center faces +Z of its light and which turns to −X, into an environment."""
    height, width, _ = pixels.shape
    rotation = to_world / np.maximum(np.linalg.norm(to_world, axis=0), 1e-12)
    directions = texel_directions(height, width).reshape(-1, 3).astype(np.float64) @ rotation
    # the center of an environment faces +X, and it turns to +Z
    x, y, z = directions.T
    local = np.stack([z, y, -x], axis=1).astype(np.float32)
    return np.ascontiguousarray(lookup(pixels, local).reshape(height, width, 3), np.float32)


def _radius(meters: float) -> float:
    """A radius or a length in the range of a look."""
    return float(np.clip(meters, *RADIUS_RANGE))


def _section(shape: dict[str, Any]) -> float:
    """Mean projected area of a sphere, π r², or of a tube, π r l / 2, m²."""
    return float(np.pi * shape["radius"] * shape.get("length", 2 * shape["radius"]) / 2)


def _capital(label: str) -> str:
    return label[0].upper() + label[1:]


def _rotation(to_world: F64, scale: F64) -> float:
    """Rotation of a rectangle about its direction, degrees; see `relume.look.model.RectangleLook`."""
    direction, up = -to_world[:3, 2] / scale[2], to_world[:3, 1] / scale[1]
    vertical = np.array([0.0, 0.0, 1.0]) if abs(direction[1]) > 1 - 1e-6 else np.array([0.0, 1.0, 0.0])
    height = vertical - direction * (vertical @ direction)
    height /= np.linalg.norm(height)
    return float(np.degrees(np.arctan2(np.cross(height, up) @ direction, height @ up)))
