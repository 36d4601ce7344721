"""Small bakes by any method, and what a look shows of them."""

from sessions import settle

from relume.bake import Recipe
from relume.memory import Memory
from relume.methods.registry import METHODS, open_bake
from relume.moving.picture import MovingPicture
from relume.picture.picture import Picture
from relume.store import bake_here


def opened(scene, method, folder):
    """A bake of 24×18 pixels under 60 lights."""
    folder.mkdir(exist_ok=True)
    recipe = Recipe(method, ("front",), (24, 18), 60, num_points=300 if method == "surface" else None)
    return open_bake(bake_here(METHODS[method], scene, recipe, folder / "store.zarr"), Memory(1 << 30))


def shown(transfer, look, method):
    """Radiance, once it is exact. (height, width, 3)"""
    if method == "surface":
        picture = MovingPicture(transfer, "front")
        picture.set_look(look)
        picture.advance(None)
    else:
        picture = Picture(transfer, "front", transfer.memory)
        picture.set_look(look)
        settle(picture)
    return picture.image()
