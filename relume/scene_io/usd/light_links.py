"""Collections of UsdLux that link lights to prims, as links to the objects of a scene."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from relume.core.import_warnings import ImporterWarning, unsupported
from relume.look.link_validation import MAX_LINKED_NAMES


def read_links(prim: Any, label: str, objects: Mapping[str, str], warnings: list[ImporterWarning]) -> dict[str, Any]:
    """Return the fields `link` and `shadow_link` of a light that does not light all objects, or cast all shadows.

    Args:
        prim: the light. label: names it in warnings.
        objects: name of each object of the scene by the path of its prim; empty if objects were merged.
        warnings: appended to.
    """
    from pxr import UsdLux

    light, links = UsdLux.LightAPI(prim), dict[str, Any]()
    for field, collection in (
        ("link", light.GetLightLinkCollectionAPI()),
        ("shadow_link", light.GetShadowLinkCollectionAPI()),
    ):
        if not _has_members(collection):
            continue
        query = collection.ComputeMembershipQuery()
        names: dict[bool, list[str]] = {True: [], False: []}
        for path, name in objects.items():
            names[query.IsPathIncluded(path)].append(name)
        mode, listed = ("include", names[True]) if len(names[True]) < len(names[False]) else ("exclude", names[False])
        if not objects or len(listed) > MAX_LINKED_NAMES:
            effect = "lights all objects" if field == "link" else "casts shadows of all objects"
            warnings.append(unsupported(f"{label[0].upper()}{label[1:]} {effect}: the scene has too many for links."))
        elif names[False]:
            links[field] = {mode: {"objects": listed}}
    return links


def _has_members(collection: Any) -> bool:
    """True if a file says what is in a collection; all objects are in others."""
    relations = collection.GetIncludesRel(), collection.GetExcludesRel()
    root = collection.GetIncludeRootAttr()
    return any(relation.GetTargets() for relation in relations) or bool(root and root.HasAuthoredValue())
