"""Small bakes of any method, and their images of a look."""

from session_edits import run_until_exact

from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.opened.openers import open_bake
from relume.methods.registry import METHODS
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process


def open_small_bake(scene, method, folder, **options):
    """A bake of 24×18 pixels under 60 lights."""
    folder.mkdir(exist_ok=True)
    recipe = Recipe(method, ("front",), (24, 18), 60, num_probes=300 if method == "probes" else None, **options)
    return open_bake(bake_in_process(METHODS[method], scene, recipe, folder / "store.zarr"), Cache(1 << 30))


def render_exact(transfer, look, method):
    """Exact radiance. (height, width, 3)"""
    if method == "probes":
        picture = FreeCameraPicture(transfer, "front")
        picture.set_look(look)
        picture.advance(None)
    else:
        picture = Picture(transfer, "front", transfer.cache)
        picture.set_look(look)
        run_until_exact(picture)
    return picture.image()
