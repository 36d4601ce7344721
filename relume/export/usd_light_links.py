"""Links of lights as collections of UsdLux."""

from __future__ import annotations

from typing import Any

from relume.look.model import IncludeLink, Link
from relume.scene.model import Scene


def write_links(prim: Any, link: Link | None, shadow_link: Link | None, scene: Scene, mesh_paths: list[Any]) -> None:
    """Write the links of a light.

    Args:
        prim: the light, a schema of UsdLux. link, shadow_link: of the light. scene: its objects.
        mesh_paths: path of each mesh.
    """
    from pxr import UsdLux

    api = UsdLux.LightAPI(prim)
    for members, collection in (
        (link, api.GetLightLinkCollectionAPI()),
        (shadow_link, api.GetShadowLinkCollectionAPI()),
    ):
        if members is None:
            continue
        is_include = isinstance(members, IncludeLink)
        names = members.include if isinstance(members, IncludeLink) else members.exclude
        targets = [
            path
            for mesh, path in zip(scene.meshes, mesh_paths, strict=True)
            if mesh.name in names.objects or scene.materials[mesh.material].name in names.materials
        ]
        collection.CreateIncludeRootAttr(not is_include)
        (collection.CreateIncludesRel() if is_include else collection.CreateExcludesRel()).SetTargets(targets)
