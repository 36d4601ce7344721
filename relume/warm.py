"""Compiles every kernel once, so that nothing compiles while somebody waits: `python -m relume.warm`.

Most of that is Numba's own work, in Python. What is inlined by `inline="always"` is typed anew at each place: the
kernel of moving pixels took 27 s so. `forceinline=True` leaves it to LLVM, which takes a tenth of that, and code is as
fast; `inline` is for helpers that are handed what holds arrays, whose references would be counted.

Bakes a thumbnail of the built-in scene, shows each term with each of its curves, and along each parameter that moves
several, moves local lights and eyes, covers surfaces with a BTF, compares with the truth, looks measured materials up.
The compiled kernels lie in the cache that `relume.kernel_cache` has chosen; every later process loads them from there.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from relume.bake import Recipe
from relume.brdf.document import complete_term
from relume.brdf.registry import TERMS
from relume.brdf.sweep import moved_curves
from relume.btf.eigen import EigenBtf
from relume.btf.rings import rings_of
from relume.btf.shelf import STORE, keep
from relume.imageio.ocio import lut
from relume.imageio.ocio.sampling import show_by
from relume.imageio.tonemap import tone_map
from relume.look import complete, validate
from relume.measured.lookup import NUM_KNOTS, Part, quotients
from relume.memory import Memory
from relume.methods.base import TransferMethod
from relume.methods.moving_views import MovingViews
from relume.methods.registry import METHODS, open_bake
from relume.moving.bumps import towards_light
from relume.moving.picture import MovingPicture
from relume.picture.picture import Picture
from relume.picture.transfer import Transfer
from relume.reference import Points, reference_radiance, texels_of
from relume.reference.covers import cover
from relume.scene.archive import load_scene, save_scene
from relume.scene.demo import demo_scene
from relume.scene.model import Scene
from relume.store import bake_here
from relume.trace.geometry import merge

SIZE, NUM_LIGHTS, NUM_POINTS = (64, 48), 256, 4000  # as many lights as are grouped
CACHE_BYTES = 1 << 28
ANALYTIC = tuple(model for model, term in TERMS.items() if not term.needs_data)
OF_RAYS = ("lambert", "ggx")  # has no angle; has one that listens to a parameter with another: rays know no more cases


def warm() -> None:
    """Bake with every method, edit each analytic term by each curve and along parameters, add and move local lights.

    Cost: a minute and a half of two cores, 20 s when everything is compiled.
    """
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        pictures = pool.submit(_warm_pictures)
        _warm_rays()
        pictures.result()


def _warm_pictures() -> None:
    """Compile what pictures of light triangles are made by, half of all there is."""
    with _scene() as (scene, folder):
        _try(METHODS["direct"], scene, folder, ANALYTIC)
        _compare(scene)
    _look_up()


def _warm_rays() -> None:
    """Compile what gather rays need more; `gather` last, by when what it shares with `direct` is there."""
    with _scene() as (scene, folder):
        for method in (METHODS["surface"], METHODS["gather"]):
            _try(method, scene, folder, OF_RAYS)


@contextmanager
def _scene() -> Iterator[tuple[Scene, Path]]:
    """The built-in scene, as the worker has it, and a folder for its bakes."""
    with tempfile.TemporaryDirectory(prefix="relume-warm-") as name:
        save_scene(demo_scene(), Path(name) / "scene")
        yield load_scene(Path(name) / "scene"), Path(name)


def _try(method: TransferMethod, scene: Scene, folder: Path, models: Iterable[str]) -> None:
    """Bake, open, edit terms of some models, and move what can be moved."""
    recipe = Recipe(method.name, (scene.cameras[0].name,), SIZE, NUM_LIGHTS, num_points=NUM_POINTS)
    transfer: Any = open_bake(bake_here(method, scene, recipe, folder / f"{method.name}.zarr"), Memory(CACHE_BYTES))
    if isinstance(transfer, MovingViews):
        _move_eyes(transfer, MovingPicture(transfer, recipe.views[0], is_watched=True))
        _cover(transfer, MovingPicture(transfer, recipe.views[0]), folder)
        return
    _cover(transfer, Picture(transfer, recipe.views[0], Memory(CACHE_BYTES)), folder)
    _edit(transfer, Picture(transfer, recipe.views[0], Memory(CACHE_BYTES)), models)
    _move_lights(transfer, Picture(transfer, recipe.views[0], Memory(CACHE_BYTES)))


def _edit(transfer: Transfer, picture: Picture, models: Iterable[str]) -> None:
    """Edit each curve of a term, and along parameters that move several."""
    material = transfer.material_names[0]
    for term in map(TERMS.__getitem__, models):
        partial = {"materials": {material: {"terms": [{"model": term.model}]}}}
        picture.set_look(validate(complete(partial, transfer.default_look), transfer.default_look))
        _show(picture)
        for curve in term.curves:
            picture.touch(f"/materials/{material}/terms/0/curves/{curve.name}")
            _show(picture)
        for parameter in (one for one in term.parameters if len(moved_curves(term, one.name)) > 1):
            picture.touch(f"/materials/{material}/terms/0/params/{parameter.name}")
            _show(picture)
    tone_map(picture.image(), 0.0, "agx")
    show_by(np.zeros((lut.SIZE, lut.SIZE, lut.SIZE, 3), np.uint16), np.zeros((1, 3), np.float32))


def _move_lights(transfer: Transfer, picture: Picture) -> None:
    """Add a light of each kind, one after another, and move each twice while it is in hand; one material is enough."""
    dark: dict[str, Any] = {name: {"terms": []} for name in transfer.material_names[1:]}
    for kind in ("point", "spot", "directional", "rectangle"):
        picture.touch("/lights/Lamp")
        for height in (1.0, 1.1, 1.2):
            geometry = {} if kind == "directional" else {"position": [0.0, height, 0.5]}
            partial = {"materials": dark, "lights": {"Lamp": {"kind": kind, "scale": height, **geometry}}}
            picture.set_look(validate(complete(partial, transfer.default_look), transfer.default_look))
            _show(picture)


def _move_eyes(transfer: MovingViews, picture: MovingPicture) -> None:
    """See what a moving eye sees, in a picture that is not all edges: kernels are the same whatever terms and lights.

    Normal maps are asked for apart, for the scene has none.
    """
    partial = {"lights": {"Lamp": {"kind": "point", "position": [0.0, 1.0, 0.5]}}}
    picture.set_look(validate(complete(partial, transfer.default_look), transfer.default_look))
    picture.advance(None)
    picture.advance(None)
    picture.set_eye(picture.eye[0], (2 * SIZE[0], 2 * SIZE[1]))
    picture.advance(None)
    nothing, all_points = np.zeros(transfer.vectors_shape, np.float32), np.ones(transfer.vectors_shape[0], np.uint8)
    towards_light(transfer.surface, nothing, all_points)
    for form in ("rgb9e5", "f32"):
        picture.encode(picture.all_tiles(), form)


def _cover(transfer: Any, picture: Picture | MovingPicture, folder: Path) -> None:
    """Show all surfaces covered with a BTF of two texels by two."""
    source, rings = folder / "btf.txt", rings_of([(0.0, 1), (45.0, 4)])
    source.write_text("grey")
    grey = EigenBtf(
        rings, np.array([[0, 2, 2], [4, 1, 1]], np.int32), np.zeros((5, 5), np.uint8), np.zeros((5, 5, 1), np.int8),
        np.array([2], np.uint8), np.full((5, 1, 5, 3), 0.1, np.float16), np.zeros((5, 1, 1, 5, 3), np.int8),
        np.ones((5, 1, 1), np.float32), np.full((5, 5, 3), 0.1, np.float32),
        np.zeros((1, 1), np.float32), (0.0, 0.0),
    )  # fmt: skip
    with STORE.at(folder / "btfs"):
        terms = keep(folder / "btfs", source, "Grey", None, lambda: grey).terms()
        _look_at_places(complete_term(("warm",), terms[0], None))
        partial = {"materials": {name: {"terms": terms} for name in transfer.material_names}}
        picture.set_look(validate(complete(partial, transfer.default_look), transfer.default_look))
        if isinstance(picture, Picture):
            _show(picture)
        else:
            picture.advance(None)


def _look_at_places(term: dict[str, Any]) -> None:
    """Find what places of a BTF send, as brute force does."""
    texels, up = TERMS[term["model"]].settled(term).texels, np.array([[0.0, 0.0, 1.0]])
    assert texels is not None
    cover(texels, np.ones((1, 5), np.float32), up, np.random.default_rng(0)).sent(np.zeros(1, np.int64), up)


def _compare(scene: Scene) -> None:
    """Find the true radiance of a point, of every texel and of a few."""
    up, aside = np.array([[0, 1, 0]], np.float32), np.array([[1, 0, 0]], np.float32)
    points = Points(position=9 * up, normal=up, tangent=aside, wo=up, textures={"diffuse": up}, roughness=up[:, 1])
    terms = [[complete_term(("warm",), {"model": "lambert"}, None)]]
    for spp in (0, 16):
        reference_radiance(merge(scene), texels_of(scene.environment), points, terms, spp)


def _look_up() -> None:
    """Divide a measured material's curves out, in both precisions that quotients are asked in."""
    table, curves = np.ones((90, 90, 180, 3), np.float32), np.ones((4, 3, NUM_KNOTS))
    for kind in (np.float32, np.float64):
        quotients(Part.DIFFUSE, table, curves, *np.array([[0], [0], [1], [0], [0], [1]], kind))


def _show(picture: Picture) -> None:
    """Freeze what waits, take a short and a full step, encode."""
    while picture.next_job():
        picture.freeze(lambda _: None, lambda: False)
    picture.advance(1)
    picture.advance(None)
    for form in ("rgb9e5", "f32"):
        picture.encode(picture.all_tiles(), form)


if __name__ == "__main__":
    warm()
