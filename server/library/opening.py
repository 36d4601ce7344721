"""The real library behind sessions: opened transfers, live pictures over one shared cache, exact renders."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from server.library.ports import Library


def open_library(cache_bytes: int, floor_bytes: int) -> Library:
    """relume's own, with one memory for all sessions, renders and comparisons together.

    Args:
        cache_bytes: that it holds at most. floor_bytes: of them, of bakes that nobody uses.
    """
    # Imported here because they load compiled kernels, which a process that only describes the API can do without.
    from relume.code_version import image_code
    from relume.memory import Memory
    from relume.methods.registry import open_transfer
    from relume.picture.picture import Picture
    from relume.reference import reference_image
    from relume.render.image import render_image, render_small
    from relume.scene.archive import load_scene

    def reference(scene: Path, *args: Any, reflects: bool) -> Any:
        return reference_image(load_scene(scene), *args, reflects=reflects)

    image_code()  # of what runs now: its files may be exchanged while it does
    memory = Memory(cache_bytes)
    return Library(
        open_transfer=lambda path: open_transfer(path, memory),
        open_in_passing=lambda path: open_transfer(path, memory.passing),
        make_picture=lambda transfer, view: Picture(transfer, view, memory, is_watched=True),
        render=render_image,
        render_small=render_small,
        reference=reference,
        held_bytes=memory.held,
        cache_used_bytes=lambda: memory.used_bytes,
        shrink_cache=lambda stores: memory.shrink(floor_bytes, {str(store.resolve()) for store in stores}),
    )
