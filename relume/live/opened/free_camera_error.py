"""Error of free-camera images in the scene's own look, measured during the bake against exact images.

    E² = Σ_p |M(p) − S(p)|² / Σ_p |S(p)|²,   ΔE = mean_p ΔE₀₀(D(M(p)), D(S(p)))

p are rays through the centers of a few pixels from a few cameras that hit a surface; M is the free-camera image along
these, S the static view, with all light paths of the method; D converts to display values. Few rays suffice to estimate
the error of large images (for a still life 64 × 48 rays give 21.4 to 21.8 % for E, 640 × 480 pixels 21.5 %).
The standard error is the jackknife over pixel blocks, because neighboring rays are correlated.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume import look as looks
from relume.core.cache import Cache
from relume.core.errors import RelumeError
from relume.core.jackknife import JackknifeEstimate, ratio_of_parts, rms_of_parts
from relume.live.free_camera.camera_paths import pivot_of, turntable
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.image_error import PixelErrors, pixel_errors
from relume.live.free_camera.static_view_jobs import StaticViewState
from relume.live.opened.free_camera_transfer import BakedFreeCamera
from relume.live.opened.static_view import StaticViewBuilder
from relume.methods.baked_error import BakedError
from relume.scene.model import Camera, Scene
from relume.store.bake_protocol import StoreReader

F64 = NDArray[np.float64]

_SIZE, _SMALL_SIZE, _BLOCK_SIZE = (64, 48), (32, 24), 8
_MAX_VIEWS = 3
_TURNTABLE_STEPS = 18  # of a full turn: as far as one drag rotates a camera
_BUDGET_BYTES = 1 << 30
_DIGITS = 3
_UNKNOWN = BakedError(*[JackknifeEstimate(np.nan, np.nan)] * 2)


def measure_error(store: StoreReader, scene: Scene, size: tuple[int, int]) -> Shaped[NDArray[np.float32], "2 2"]:
    """Return ΔE and E with their standard errors; NaN if everything is dark or the memory budget is exceeded.

    Args:
        store: store of a bake with a free camera, complete except for this result. scene: with its cameras.
        size: default width and height of the images; small ones are measured with fewer rays.
    """
    # no folder: images are not saved beside an unfinished bake
    transfer = BakedFreeCamera.from_store(store, f"unfinished bake/{scene.id}", Cache(_BUDGET_BYTES), is_measured=False)
    try:
        rays = _SIZE if size[0] * size[1] >= _SIZE[0] * _SIZE[1] else _SMALL_SIZE
        estimates = _estimate_error(transfer, StaticViewBuilder(transfer.light_transport, scene), rays)
    except RelumeError:
        estimates = _UNKNOWN
    return np.round(estimates, _DIGITS).astype(np.float32)


def _estimate_error(transfer: BakedFreeCamera, static_views: StaticViewBuilder, rays: tuple[int, int]) -> BakedError:
    look = looks.validate(transfer.default_look, transfer.default_look)
    free_picture = FreeCameraPicture(transfer, next(iter(transfer.views)))
    free_picture.set_look(look)
    block_sums = []
    for camera in _cameras(transfer):
        view = StaticViewState(static_views.make_static_view, transfer.cache.transient, (camera, rays), look, None)
        block_sums.append(_block_sums(free_picture, view))
    errors = PixelErrors(*np.concatenate(block_sums, axis=1))
    if np.count_nonzero(errors.squared_radiance) < 2:
        return _UNKNOWN
    return BakedError(
        ratio_of_parts(errors.delta_e, errors.is_surface), rms_of_parts(errors.squared_error, errors.squared_radiance)
    )


def _cameras(transfer: BakedFreeCamera) -> Sequence[Camera]:
    """Return the initial cameras, and turntable positions of the first."""
    views = list(transfer.views.values())[:_MAX_VIEWS]
    turntable_cameras = turntable(views[0].camera, pivot_of(transfer, views[0].camera), _TURNTABLE_STEPS)
    return [*(view.camera for view in views), turntable_cameras[1], turntable_cameras[-1]]


def _block_sums(free_picture: FreeCameraPicture, view: StaticViewState) -> F64:
    """Sum the fields of `PixelErrors` over blocks of rays. (4, blocks)

    Args:
        free_picture: in the light of the view. view: the reference.
    """
    free_picture.set_camera(*view.sized_camera)
    image, gbuffer = free_picture.render_moving(only_centers=True)
    exact = view.static_picture(lambda share: None, lambda: False, smooths_edges=False).image()
    width, height = view.sized_camera[1]
    errors = np.stack(pixel_errors(image, exact, gbuffer, view.look.display))
    blocks = errors.reshape(len(errors), height // _BLOCK_SIZE, _BLOCK_SIZE, width // _BLOCK_SIZE, _BLOCK_SIZE)
    return np.asarray(blocks.sum(axis=(2, 4)).reshape(len(errors), -1))
