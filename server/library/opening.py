"""The real library behind sessions: opened transfers, live pictures over one shared cache, exact renders."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from server.library.ports import Library
from worker.paths import scene_of_bake
from worker.storage import fetched, open_kept

if TYPE_CHECKING:
    from relume.scene.model import Camera


def open_library(cache_bytes: int, floor_bytes: int) -> Library:
    """relume's own, with one memory for all sessions, renders and comparisons together.

    Args:
        cache_bytes: that it holds at most. floor_bytes: of them, of bakes that nobody uses.
    """
    # Imported here because they load compiled kernels, which a process that only describes the API can do without.
    from relume.code_version import image_code
    from relume.memory import Memory, use_for_assets
    from relume.methods.registry import open_bake
    from relume.methods.stills import Stills
    from relume.moving.picture import MovingPicture
    from relume.moving.rest.resting import RestingPicture
    from relume.moving.shader.geometry import arrays_of, constants
    from relume.picture.picture import Picture
    from relume.picture.transfer import Eyes
    from relume.reference import reference_truth
    from relume.render.finder import Finder
    from relume.render.image import render_image, render_small
    from relume.scene.archive import load_scene
    from relume.scene.placed_camera import with_cameras

    def reference(scene: Path, camera: Camera, *args: Any, **paths: Any) -> Any:
        return reference_truth(with_cameras(load_scene(fetched(scene)), [camera]), camera.name, *args, **paths)

    def finder(scene: Path) -> Finder:
        return memory.passing.keep((str(scene), "finder"), lambda: Finder.of(load_scene(fetched(scene))))

    def stills_of(transfer: Any) -> Stills:
        scene = scene_of_bake(Path(transfer.key), transfer.scene_id)
        return memory.passing.keep((transfer.key, "scene"), lambda: Stills(transfer.lit, load_scene(fetched(scene))))

    def picture(transfer: Any, view: str) -> Any:
        if transfer.eyes is not Eyes.FREE:
            return Picture(transfer, view, memory, is_watched=True)

        def still(*of_eye: Any, **how: Any) -> Any:
            return stills_of(transfer).make(*of_eye, **how)  # in the job's thread: reading a scene takes its time

        return RestingPicture(MovingPicture(transfer, view, is_watched=True), still, memory)

    def render(transfer: Any, view: str, look: Any, *, exact: bool = True, **rest: Any) -> Any:
        stills = stills_of(transfer) if exact and transfer.eyes is Eyes.FREE else None
        return render_image(transfer, view, look, stills=stills, **rest)

    image_code()  # of what runs now: its files may be exchanged while it does
    memory = Memory(cache_bytes)
    use_for_assets(memory)
    return Library(
        open_transfer=lambda path: open_kept(path, lambda store: open_bake(store, memory)),
        open_in_passing=lambda path: open_kept(path, lambda store: open_bake(store, memory.passing)),
        make_picture=picture,
        render=render,
        render_small=render_small,
        reference=reference,
        finder=finder,
        shader_arrays=lambda transfer: (constants(transfer), arrays_of(transfer)),
        held_bytes=memory.held,
        cache_used_bytes=lambda: memory.used_bytes,
        shrink_cache=lambda stores: memory.shrink(floor_bytes, {str(store.resolve()) for store in stores}),
    )
