"""A bake as if its scene had the object materials of a look: its rows by material, sorted anew.

Nothing in a bake depends on the terms of a material but numbers of rays, so that samples, patches and probes of some
objects may have another one. Their objects are those of the surfaces below them; rows of a store are sorted by
material, so object materials come after those of the scene.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.camera.view_samples import BACKGROUND
from relume.core.errors import StoreError
from relume.core.validation import invalid_value
from relume.look.object_materials import ObjectMaterial, ObjectMaterials, check_objects
from relume.probes.lattice_nodes import LatticeNodes
from relume.probes.triangle_grids import ProbeGrid, num_nodes
from relume.raytrace.alpha_filter import STOP_AT_PARTIAL
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.embree import EmbreeScene
from relume.store.bake_protocol import StoreReader
from relume.store.optional_arrays import has_array

F32 = NDArray[np.float32]
Materials = NDArray[np.integer[Any]]
Rows = NDArray[np.int64]

_BY_MATERIAL = (  # attributes with an entry for each material
    "materials",
    "double_sided",
    "frost",
    "roughness_levels",
    "shortest_normals",
    "textures",
    "normal_maps",
    "emission_images",
    "roughness_maps",
    "gather_rays",
)
_PROBE_TRANSFER = ("sh/cluster", "sh/weight")  # with a row for each probe, like "probes/…"


class ObjectMaterialStore:
    """A read-only store with other materials.

    Args:
        store: of the bake. embree: its triangles, all of them. materials: object materials of a look.
    Raises:
        ParameterError: an object is not of the base material, or the base material is a mirror.
        StoreError: the bake is too old.
    """

    def __init__(self, store: StoreReader, embree: EmbreeScene, materials: ObjectMaterials) -> None:
        self._store, self._embree = store, embree
        self._names: list[str] = list(store.attributes["materials"])
        self._bases = [self._names.index(material.base) for material in materials]
        self._face_material = self._assign_faces(materials)
        self._attributes = self._extended_attributes(materials)
        self._rows: dict[str, Rows] = {}  # of arrays whose paths begin so
        self._arrays: dict[str, NDArray[Any]] = {"scene/face_material": self._face_material}
        if store.attributes.get("has_alpha_test"):
            rule = store.read("alpha_masks/material_rule")
            self._arrays["alpha_masks/material_rule"] = np.append(rule, rule[self._bases])
        if has_array(store, "patches/material"):
            self._assign_patches()
        if has_array(store, "probes/material"):
            self._assign_probes()
        else:
            for k in range(len(store.attributes["views"])):
                self._assign_samples(f"views/{k}/")
        self._check_mirrors(materials)

    @property
    def attributes(self) -> Mapping[str, Any]:
        """Attributes of the store; those of the object materials are their bases'."""
        return self._attributes

    def shape(self, path: str) -> tuple[int, ...]:
        """Shape of an array."""
        if path in self._arrays:
            return self._arrays[path].shape
        shape, order = self._store.shape(path), self._order(path)
        return shape if order is None else (shape[0] + len(order) - self._num_baked(path), *shape[1:])

    def read(self, path: str, start: int = 0, stop: int | None = None) -> NDArray[Any]:
        """Read rows [start, stop) of the array at a path, in the order of this store."""
        if path in self._arrays:
            return self._arrays[path][start:stop]
        order = self._order(path)
        if order is None:
            return self._store.read(path, start, stop)
        rows = order[: self.shape(path)[0]][start:stop]
        first, end = (int(rows.min()), int(rows.max()) + 1) if len(rows) else (0, 0)
        return self._store.read(path, first, end)[rows - first]

    def _order(self, path: str) -> Rows | None:
        """Return the row in the bake of each row of an array; None if they are in the same order."""
        return self._rows.get(_folder(path))

    def _num_baked(self, path: str) -> int:
        return self._store.shape(f"{_folder(path)}material")[0]

    def _assign_faces(self, materials: Sequence[ObjectMaterial]) -> NDArray[np.int32]:
        """Return the material of each triangle."""
        names = self._store.attributes.get("objects")
        if not names:
            raise StoreError("this bake is too old for materials of objects; bake the scene again")
        mesh, before = self._store.read("scene/face_mesh"), self._store.read("scene/face_material")
        after = np.array(before, np.int32)
        for k, (material, base) in enumerate(zip(materials, self._bases, strict=True)):
            check_objects(material, {names[each] for each in np.unique(mesh[before == base])})
            is_object = np.isin(names, material.objects)[mesh] & (before == base)
            after[is_object] = len(self._names) + k
        return after

    def _extended_attributes(self, materials: Sequence[ObjectMaterial]) -> dict[str, Any]:
        attributes = dict(self._store.attributes)
        for name in _BY_MATERIAL:
            if attributes.get(name):
                attributes[name] = [*attributes[name], *(attributes[name][base] for base in self._bases)]
        attributes["materials"] = [*self._names, *(material.name for material in materials)]
        look = attributes["look"]
        copies = {
            material.name: {**look["materials"][material.base], "base": material.base, "objects": [*material.objects]}
            for material in materials
        }
        attributes["look"] = {**look, "materials": {**look["materials"], **copies}}
        return attributes

    def _assign(self, material: Materials, position: F32, normal: F32) -> Materials:
        """Return the materials of points. material: in the bake. position, normal: offset from the surface"""
        rows = np.flatnonzero(np.isin(material, self._bases))
        face = trace_rays(self._embree, position[rows], -normal[rows], STOP_AT_PARTIAL).face
        is_same = (face >= 0) & (self._store.read("scene/face_material")[face] == material[rows])
        out = material.copy()
        out[rows[is_same]] = self._face_material[face[is_same]]
        return out

    def _assign_samples(self, prefix: str) -> None:
        """Sort the samples of a view by their materials; background samples stay last."""
        material = self._store.read(f"{prefix}material")
        num = int(np.searchsorted(material, BACKGROUND))
        names = "position", "surface_normal" if has_array(self._store, f"{prefix}surface_normal") else "normal"
        points = (np.asarray(self._store.read(prefix + name, 0, num), np.float32) for name in names)
        assigned = np.append(self._assign(material[:num], *points), material[num:])
        order = np.argsort(assigned, kind="stable")
        self._rows[prefix], self._arrays[f"{prefix}material"] = order, assigned[order]

    def _assign_patches(self) -> None:
        position, normal = (
            np.asarray(self._store.read(f"patches/{name}"), np.float32) for name in ("position", "normal")
        )
        material = self._store.read("patches/material")
        self._arrays["patches/material"] = self._assign(material, position[:, 0], normal[:, 0])

    def _assign_probes(self) -> None:
        """Copy the probes and lattice nodes of assigned triangles, which may share them with others."""
        grid = {name: self._store.read(f"nodes/{name}") for name in ProbeGrid._fields}
        nodes = {name: self._store.read(f"nodes/{name}") for name in LatticeNodes._fields}
        material, node_index = self._store.read("probes/material"), grid["node_index"].copy()
        order, counts = np.arange(len(material)), num_nodes(grid["num_rows"].ravel())
        for index in range(len(self._names), len(self._attributes["materials"])):
            is_assigned = np.repeat(np.repeat(self._face_material == index, 2), counts)
            node, node_copy = np.unique(node_index[is_assigned], return_inverse=True)
            node_index[is_assigned] = len(nodes["probe"]) + node_copy
            copies = {name: values[node] for name, values in nodes.items()}
            is_used = copies["weight"] > 0
            probe, probe_copy = np.unique(copies["probe"][is_used], return_inverse=True)
            copies["probe"][is_used] = len(order) + probe_copy
            nodes = {name: np.concatenate([values, copies[name]]) for name, values in nodes.items()}
            order = np.append(order, probe)
            material = np.append(material, np.full(len(probe), index, material.dtype))
        self._rows["probes/"] = order
        self._arrays |= {f"nodes/{name}": values for name, values in nodes.items()}
        self._arrays |= {"nodes/node_index": node_index, "probes/material": material}

    def _check_mirrors(self, materials: Sequence[ObjectMaterial]) -> None:
        """Raise ParameterError if a base material is a mirror: the bake has traced what its surfaces show."""
        paths = [f"views/{k}/mirror" for k in range(len(self._attributes["views"]))]
        paths = [path for path in [*paths, "mirror_lights/material"] if has_array(self._store, path)]
        mirrors = {int(index) for path in paths for index in np.unique(self._store.read(path))}
        for material, base in zip(materials, self._bases, strict=True):
            if base in mirrors:
                pointer = "materials", material.name, "base"
                raise invalid_value(pointer, material.base, "a material that is no mirror in the scene")


def _folder(path: str) -> str:
    """Return the start of the paths of arrays that have the same rows as an array."""
    return "probes/" if path in _PROBE_TRANSFER else path[: path.rfind("/") + 1]
