"""Compiles every kernel, so that a container starts with them: bakes the smoke test's scene and edits each term."""

from __future__ import annotations

import tempfile
from pathlib import Path

import smoke_scene

from relume.brdf.registry import TERMS
from relume.light.environment import read_environment
from relume.look import complete, validate
from relume.scene.gltf import import_gltf
from relume.store import bake_here
from relume.transfer.base import Recipe
from relume.transfer.cache import FrozenCache
from relume.transfer.opened import open_transfer
from relume.transfer.picture import Picture
from relume.transfer.registry import METHODS

BUDGET_BYTES = 1 << 28


def main() -> None:
    """Bake, then show each term with each of its curves in turn."""
    scene = import_gltf(smoke_scene.glb(), "warm", read_environment(smoke_scene.hdr(), "sky"))
    with tempfile.TemporaryDirectory() as folder:
        recipe = Recipe("direct", (scene.cameras[0].name,), (64, 48), 64)
        store = bake_here(METHODS["direct"], scene, recipe, Path(folder) / "warm.zarr")
        transfer = open_transfer(store)
        picture = Picture(transfer, recipe.views[0], FrozenCache(BUDGET_BYTES))
        material = transfer.material_names[0]
        for term in TERMS.values():
            partial = {"materials": {material: {"terms": [{"model": term.model}]}}}
            picture.set_look(validate(complete(partial, transfer.default_look), transfer.default_look))
            show(picture)
            for curve in term.curves:
                picture.touch(f"/materials/{material}/terms/0/curves/{curve.name}")
                show(picture)


def show(picture: Picture) -> None:
    """Freeze what waits, take a short and a full step, encode."""
    while picture.waiting():
        picture.freeze(lambda _: None, lambda: False)
    picture.advance(1)
    picture.advance(None)
    for form in ("rgb9e5", "f32"):
        picture.encode(picture.all_tiles(), form)


if __name__ == "__main__":
    main()
