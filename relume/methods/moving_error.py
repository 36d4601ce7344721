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
from relume.bake import StoreReader
from relume.errors import RelumeError
from relume.estimated import Estimated, root_of_shares
from relume.memory import Memory
from relume.methods.moving_views import MovingViews
from relume.methods.stills import Stills
from relume.moving.paths import looked_at, turntable
from relume.moving.picture import MovingPicture
from relume.moving.rest.still_jobs import ExactView
from relume.scene.model import Camera, Scene

F64 = NDArray[np.float64]

_SIZE, _OF_SMALL, _SQUARE = (64, 48), (32, 24), 8
_MOST_VIEWS = 3
_TURN = 18  # steps of a turntable: as far as a hand turns an eye at once
_BUDGET_BYTES = 1 << 30
POINT_BYTES = 2600  # of a point while it is measured: six light vectors of 36 functions
BYTES = 300 << 20  # what else is made: tables, skies, stills
_DIGITS = 4


def measured(store: StoreReader, scene: Scene, size: tuple[int, int]) -> NDArray[np.float32]:
    """The error and its standard error; not a number where all is dark, or it takes more than there is. (2,) float32

    Args:
        store: of a bake whose eyes move, everything else in it. scene: with its cameras.
        size: width and height that its pictures begin with; fewer rays do where they are small.
    """
    # no folder is there for what pictures keep beside a bake
    transfer = MovingViews.of(store, f"bake in making/{scene.id}", Memory(_BUDGET_BYTES))
    try:
        rays = _SIZE if size[0] * size[1] >= _SIZE[0] * _SIZE[1] else _OF_SMALL
        found = _measured(transfer, Stills(transfer.lit, scene), rays)
    except RelumeError:
        found = Estimated(np.nan, np.nan)
    return np.round(found, _DIGITS).astype(np.float32)


def _measured(transfer: MovingViews, stills: Stills, rays: tuple[int, int]) -> Estimated:
    look = looks.validate(transfer.default_look, transfer.default_look)
    moving = MovingPicture(transfer, next(iter(transfer.views)))
    moving.set_look(look)
    squares = []
    for camera in _eyes(transfer):
        view = ExactView(stills.make, transfer.memory.passing, (camera, rays), look, None)
        squares.append(_of_eye(moving, view))
    off, of = np.concatenate(squares, axis=1)
    if np.count_nonzero(of) < 2:
        return Estimated(np.nan, np.nan)
    return root_of_shares(off, of)


def _eyes(transfer: MovingViews) -> Sequence[Camera]:
    """Where eyes begin, and, of the first, where a hand may turn it to."""
    views = list(transfer.views.values())[:_MOST_VIEWS]
    around = turntable(views[0].camera, looked_at(transfer, views[0].camera), _TURN)
    return [*(view.camera for view in views), around[1], around[-1]]


def _of_eye(moving: MovingPicture, view: ExactView) -> F64:
    """Sums over squares of rays: what the moving picture is off by, and what there is, both squared. (2, squares)

    Args:
        moving: in the light of the view. view: what is to be seen.
    """
    moving.set_eye(*view.eye)
    found, seen = moving.along_middles(view.eye[1], is_fine=False)
    exact = view.picture(lambda share: None, lambda: False, smooths_edges=False).image().astype(np.float64)
    width, height = view.eye[1]
    is_hit = (seen.hits.face >= 0).reshape(height, width)
    both = np.stack([((found - exact) ** 2).sum(axis=2), (exact**2).sum(axis=2)]) * is_hit
    squares = both.reshape(2, height // _SQUARE, _SQUARE, width // _SQUARE, _SQUARE)
    return np.asarray(squares.sum(axis=(2, 4)).reshape(2, -1), np.float64)
