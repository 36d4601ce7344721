"""Implementation of the sessions' library: open bakes, live images with one shared cache, exact renders."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume_server.runtime.protocols import Library
from relume_worker.paths import scene_path_of_bake
from relume_worker.storage import fetch_if_missing, open_cached

if TYPE_CHECKING:
    from relume.scene.model import Camera, Scene


def open_library(cache_bytes: int, floor_bytes: int) -> Library:
    """Create the library, with one cache for all sessions, renders and comparisons.

    Args:
        cache_bytes: budget of the cache. floor_bytes: part of it for bakes that are not in use.
    """
    # Imported here because they load compiled kernels, which a process that only describes the API does not need.
    from relume.core.cache import Cache, use_for_assets
    from relume.core.source_hash import image_code
    from relume.inverse_lighting.sources import image_key
    from relume.live.fixed_camera.picture import Picture
    from relume.live.fixed_camera.protocols import CameraMode
    from relume.live.free_camera.browser.geometry_arrays import array_factories, constants
    from relume.live.free_camera.free_camera_picture import FreeCameraPicture
    from relume.live.free_camera.progressive_picture import ProgressivePicture
    from relume.live.opened.openers import open_bake
    from relume.live.opened.static_view import StaticViewBuilder
    from relume.output.exr.aovs import AovTracer
    from relume.output.render_image import needs_tracing, render_image, render_small, small_size
    from relume.output.viewport import Viewport
    from relume.reference import render_reference
    from relume.scene.custom_camera import with_cameras
    from relume.scene.scene_folder import load_scene

    def reference(scene: Path, camera: Camera, *args: Any, **paths: Any) -> Any:
        return render_reference(
            with_cameras(load_scene(fetch_if_missing(scene)), [camera]), camera.name, *args, **paths
        )

    def open_viewport(scene: Path) -> Viewport:
        return memory.transient.get_value(
            (str(scene), "finder"), lambda: Viewport.from_scene(load_scene(fetch_if_missing(scene)))
        )

    def scene_of(transfer: Any) -> Scene:
        return load_scene(fetch_if_missing(scene_path_of_bake(Path(transfer.key), transfer.scene_id)))

    def static_view_builder(transfer: Any) -> StaticViewBuilder:
        return memory.transient.get_value(
            (transfer.key, "scene"), lambda: StaticViewBuilder.from_bake(transfer, scene_of(transfer))
        )

    def aov_tracer(transfer: Any, look: Any) -> AovTracer:
        """The tracer of a look, which all frames of a turntable share."""
        key = transfer.key, "AOVs", look.model_dump_json()
        return memory.transient.get_value(key, lambda: AovTracer.from_look(scene_of(transfer), look))

    def make_picture(transfer: Any, view: str) -> Any:
        def make_static_view(*camera_args: Any, **options: Any) -> Any:
            # in the job's thread, because reading a scene takes long
            return static_view_builder(transfer).make_static_view(*camera_args, **options)

        if transfer.camera_mode is not CameraMode.FREE:
            return Picture(transfer, view, memory, is_watched=True, make_static_view=make_static_view)
        return ProgressivePicture(FreeCameraPicture(transfer, view, is_watched=True), make_static_view, memory)

    def render(transfer: Any, view: str, look: Any, *, exact: bool = True, **options: Any) -> Any:
        # frames of a free camera are shown without tracing, if they need not be exact
        is_traced = needs_tracing(transfer, look) and (exact or transfer.camera_mode is not CameraMode.FREE)
        static_views = static_view_builder(transfer) if is_traced else None
        return render_image(transfer, view, look, static_views=static_views, **options)

    def small_renderer(transfer: Any, view: str, width: int, camera_and_size: Any) -> Any:
        camera_key = None if camera_and_size is None else _camera_key(*camera_and_size)

        def render_cached(look: Any) -> Any:
            key = transfer.key, "light images", view, width, camera_key, image_key(look)
            return transfer.cache.transient.get_value(
                key, lambda: render_small(transfer, view, look, width, camera_and_size)
            )

        return small_size(transfer, view, width, camera_and_size), render_cached

    def _camera_key(camera: Camera, size: tuple[int, int]) -> tuple[Any, ...]:
        return camera.to_world.tobytes(), camera.yfov, camera.near, size

    image_code()  # of the running version: its files may be replaced meanwhile
    memory = Cache(cache_bytes)
    use_for_assets(memory)
    return Library(
        open_transfer=lambda path: open_cached(path, lambda store: open_bake(store, memory)),
        open_transient=lambda path: open_cached(path, lambda store: open_bake(store, memory.transient)),
        make_picture=make_picture,
        render=render,
        aov_tracer=aov_tracer,
        render_small=render_small,
        small_renderer=small_renderer,
        reference=reference,
        open_viewport=open_viewport,
        shader_arrays=lambda transfer: (constants(transfer), array_factories(transfer)),
        bytes_by_owner=memory.bytes_by_owner,
        cache_used_bytes=lambda: memory.used_bytes,
        trim_cache=lambda stores: memory.trim(floor_bytes, {str(store.resolve()) for store in stores}),
    )
