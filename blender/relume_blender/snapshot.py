"""A scene of Blender on its way to a server, and the record of one that was sent."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Self

from .glb import Glb, Json, add_lights, remove_empty_nodes, scene_key, slugs, unique_names

_MAX_SCENE_NAME = 100


@dataclass(frozen=True)
class Snapshot:
    """A scene as it is sent.

    Attributes:
        name: of the scene. glb: with names that the server keeps. environment: path of its file.
        look: lights, display, and intensity of the environment, a partial look.
        views: names of the cameras to bake; none lets the server frame the scene.
        materials, lights: names of materials and of light objects in Blender, by their names in looks.
        key: of all that a look cannot change, the environment aside. environment_key: of the environment.
        omitted: sentences about what is left out.
    """

    name: str
    glb: Glb
    environment: Path
    look: Json
    views: tuple[str, ...]
    materials: Mapping[str, str]
    lights: Mapping[str, str]
    key: str
    environment_key: str
    omitted: tuple[str, ...]

    @property
    def material_documents(self) -> dict[str, Json]:
        """Materials of the file by name."""
        return {material["name"]: material for material in self.glb.document.get("materials", ())}


@dataclass(frozen=True)
class Sent:
    """Record of what a server has, stored in the .blend file as text.

    Attributes:
        url: of the server. scene, bake: ids. link: address of the shared look.
        look: the shared look, partial. key, environment_key, materials, lights: of the snapshot.
        material_documents: as in the snapshot.
    """

    url: str
    scene: str
    bake: str
    link: str
    look: Json
    key: str
    environment_key: str
    materials: Mapping[str, str]
    lights: Mapping[str, str]
    material_documents: Mapping[str, Json] = field(default_factory=dict)

    def to_text(self) -> str:
        """JSON of the record."""
        return json.dumps(asdict(self))

    @classmethod
    def from_text(cls, text: str) -> Self | None:
        """Read a record; None if there is none, or another version wrote it."""
        try:
            return cls(**json.loads(text))
        except (ValueError, TypeError):
            return None


def make_snapshot(
    name: str,
    exported: bytes,
    environment: tuple[Path, str],
    lights: Mapping[str, Json],
    sections: Json,
    active_camera: str | None,
    omitted: tuple[str, ...],
) -> Snapshot:
    """Return a snapshot.

    Args:
        name: of the scene. exported: a GLB file without lights. environment: .exr, and hash of its pixels.
        lights: of a look, by name of their objects; of instances, a name that is no object's.
        sections: display and environment of the look. active_camera: name of its data in the file; None without one.
        omitted: sentences about what is left out.
    """
    glb = Glb.from_bytes(exported)
    remove_empty_nodes(glb.document)
    material_names = _rename(glb.document.get("materials", []))
    names = unique_names(lights, material_names)  # an emissive material is a light of its name
    named_lights = dict(zip(names, lights.values(), strict=True))
    view = _rename_cameras(glb.document.get("cameras", []), active_camera)
    key = scene_key(glb)
    add_lights(glb.document, named_lights)
    printable = "".join(c for c in name if c.isprintable()).strip()[:_MAX_SCENE_NAME]
    return Snapshot(
        name=printable or "Scene",
        glb=glb,
        environment=environment[0],
        look={"lights": named_lights, **sections},
        views=() if view is None else (view,),
        materials=material_names,
        lights=dict(zip(names, lights, strict=True)),
        key=key,
        environment_key=environment[1],
        omitted=omitted,
    )


def _rename(materials: list[Json]) -> dict[str, str]:
    """Give materials names that the server keeps; returns their former names by the new ones."""
    names = [material.get("name", "") for material in materials]
    unique = unique_names(names)
    for material, name in zip(materials, unique, strict=True):
        material["name"] = name
    return dict(zip(unique, names, strict=True))


def _rename_cameras(cameras: list[Json], active: str | None) -> str | None:
    """Give cameras names that the server keeps; returns that of the active one if the server can show it."""
    names = [camera.get("name", "") for camera in cameras]
    unique = slugs(names)
    for camera, name in zip(cameras, unique, strict=True):
        camera["name"] = name
    is_shown = active in names and cameras[names.index(active)]["type"] == "perspective"
    return unique[names.index(active)] if active is not None and is_shown else None
