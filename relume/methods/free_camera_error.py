"""How far the moving pictures of a bake are off in the scene's own look, measured where it is baked against exact ones.

    E² = Σ_p |M(p) − S(p)|² / Σ_p |S(p)|²

p are rays through the middles of few pixels from a few eyes, where they hit a surface; M is what a moving eye is shown
along them, S what is shown where it rests, with all light paths of the method. Points of a picture err as its pixels
do: few of them tell what large pictures are off by (of a still life 64 × 48 rays 21.4 to 21.8 %, 640 × 480 pixels
21.5 %).
The standard error is that of leaving out squares of rays, which are alike inside.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from relume import look as looks
from relume.core.cache import Cache
from relume.core.errors import RelumeError
from relume.core.jackknife import JackknifeEstimate, rms_of_parts
from relume.live.free_camera.camera_paths import pivot_of, turntable
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.refinement.refinement_jobs import StaticViewState
from relume.methods.free_camera_transfer import BakedFreeCamera
from relume.methods.static_view import StaticViewBuilder
from relume.scene.model import Camera, Scene
from relume.store.bake_protocol import StoreReader

F64 = NDArray[np.float64]

_SIZE, _SMALL_SIZE, _BLOCK_SIZE = (64, 48), (32, 24), 8
_MAX_VIEWS = 3
_TURNTABLE_STEPS = 18  # steps of a turntable: as far as a hand turns an eye at once
_BUDGET_BYTES = 1 << 30
PROBE_BYTES = 2600  # of a point while it is measured: six light vectors of 36 functions
BYTES = 300 << 20  # what else is made: tables, skies, stills
_DIGITS = 4


def measure_error(store: StoreReader, scene: Scene, size: tuple[int, int]) -> NDArray[np.float32]:
    """The error and its standard error; not a number where all is dark, or it takes more than there is. (2,) float32

    Args:
        store: of a bake whose eyes move, everything else in it. scene: with its cameras.
        size: width and height that its pictures begin with; fewer rays do where they are small.
    """
    # no folder is there for what pictures keep beside a bake
    transfer = BakedFreeCamera.from_store(store, f"bake in making/{scene.id}", Cache(_BUDGET_BYTES))
    try:
        rays = _SIZE if size[0] * size[1] >= _SIZE[0] * _SIZE[1] else _SMALL_SIZE
        estimate = _estimate_error(transfer, StaticViewBuilder(transfer.light_transport, scene), rays)
    except RelumeError:
        estimate = JackknifeEstimate(np.nan, np.nan)
    return np.round(estimate, _DIGITS).astype(np.float32)


def _estimate_error(
    transfer: BakedFreeCamera, static_views: StaticViewBuilder, rays: tuple[int, int]
) -> JackknifeEstimate:
    look = looks.validate(transfer.default_look, transfer.default_look)
    free_picture = FreeCameraPicture(transfer, next(iter(transfer.views)))
    free_picture.set_look(look)
    block_sums = []
    for camera in _cameras(transfer):
        view = StaticViewState(static_views.make_static_view, transfer.cache.transient, (camera, rays), look, None)
        block_sums.append(_block_sums(free_picture, view))
    squared_error, squared_reference = np.concatenate(block_sums, axis=1)
    if np.count_nonzero(squared_reference) < 2:
        return JackknifeEstimate(np.nan, np.nan)
    return rms_of_parts(squared_error, squared_reference)


def _cameras(transfer: BakedFreeCamera) -> Sequence[Camera]:
    """Where eyes begin, and, of the first, where a hand may turn it to."""
    views = list(transfer.views.values())[:_MAX_VIEWS]
    turntable_cameras = turntable(views[0].camera, pivot_of(transfer, views[0].camera), _TURNTABLE_STEPS)
    return [*(view.camera for view in views), turntable_cameras[1], turntable_cameras[-1]]


def _block_sums(free_picture: FreeCameraPicture, view: StaticViewState) -> F64:
    """Sums over squares of rays: what the moving picture is off by, and what there is, both squared. (2, squares)

    Args:
        free_picture: in the light of the view. view: what is to be seen.
    """
    free_picture.set_camera(*view.sized_camera)
    image, gbuffer = free_picture.render_pixel_centers(view.sized_camera[1], is_fine=False)
    exact = view.static_picture(lambda share: None, lambda: False, smooths_edges=False).image().astype(np.float64)
    width, height = view.sized_camera[1]
    is_hit = (gbuffer.hits.face >= 0).reshape(height, width)
    squared = np.stack([((image - exact) ** 2).sum(axis=2), (exact**2).sum(axis=2)]) * is_hit
    blocks = squared.reshape(2, height // _BLOCK_SIZE, _BLOCK_SIZE, width // _BLOCK_SIZE, _BLOCK_SIZE)
    return np.asarray(blocks.sum(axis=(2, 4)).reshape(2, -1), np.float64)
