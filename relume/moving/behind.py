"""What a moving eye sees past surfaces, and on grounds that only catch shadows.

As in fixed views (`relume.picture.background.backdrop`), a catcher shows what lies behind it times what arrives there
over what would arrive if nothing but the ground were there; where nothing would, nothing is hidden.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.color import LUMINANCE, srgb_encode
from relume.look.model import BackgroundLook
from relume.moving.look_up import Seen
from relume.moving.points.surface import Surface
from relume.moving.sky import fill_sky
from relume.moving.transfer import MovingTransfer
from relume.parallel import for_shares
from relume.picture.background.backdrop import MOST_SHARE
from relume.picture.light import Light
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]

_MOST = np.float32(MOST_SHARE)


class Caught(NamedTuple):
    """What catchers compare with.

    Attributes:
        is_catcher: of every material. (materials,) bool
        unhidden: what a white surface at each vertex of catchers would send if nothing were in the light's way.
            (vertices or 0, 3) float32
    """

    is_catcher: NDArray[np.bool_]
    unhidden: F32


def seen_behind(
    transfer: MovingTransfer,
    background: BackgroundLook,
    light: Light,
    gain: F32,
    seen: Seen,
    is_catcher: NDArray[np.bool_],
) -> F32:
    """Find what lies behind, where the background or a catcher is seen. (rays, 3) float32

    Args:
        transfer: of the picture. background, light: of its look. gain: of the finished picture, in each channel. (3,)
        seen: by the rays. is_catcher: of every material. (materials,)
    """
    num = len(seen.directions)
    if background.kind == "color":
        return np.tile(np.array(background.color, np.float32), (num, 1))
    behind = np.zeros((num, 3), np.float32)
    if background.kind != "transparent":
        past, of_face = seen.hits.face, transfer.surface.face_material
        if is_catcher.any():
            past = np.where((past >= 0) & is_catcher[of_face[np.maximum(past, 0)]], -1, past).astype(np.int32)
        radiance = transfer.map_of(light.environment.map, background.blur if background.kind == "blurred" else 0.0)
        shown = np.array(light.environment_gain, np.float32) * gain
        fill_sky(radiance, light.environment.rotation, shown, past, seen.directions, behind)
    return behind


def lay_over(surface: Surface, seen: Seen, behind: F32, caught: Caught, gain: F32, *, is_direct: bool, out: F32) -> F32:
    """Put surfaces over what is behind them, and shadows of catchers onto it.

    Args:
        surface: that is seen. seen: by the rays. behind: from `seen_behind`. caught: by catchers.
        gain: that `out` has been multiplied by. (3,) float32
        is_direct: light that comes straight is shown, and with it the background.
        out: radiance of surfaces, of catchers as white ones; changed to the picture. (rays, 3) float32
    Returns:
        How much of the light behind it is hidden along each ray. (rays,) float32
    """
    hides = np.empty(len(out), np.float32)
    args = (
        np.array(LUMINANCE, np.float32), seen.hits.face, surface.face_material, caught.is_catcher, caught.unhidden,
        seen.vertex, seen.weight, behind, np.asarray(gain, np.float32), is_direct,
    )  # fmt: skip
    for_shares(lambda start, stop: _lay_over(*args, start, stop, out, hides), len(out))
    return hides


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _lay_over(  # type: ignore[no-untyped-def]
    luminance, face, face_material, is_catcher, unhidden, vertex, weight, behind, gain, is_direct, start, stop, out,
    hides,
):  # fmt: skip
    """Do so for rays [start, stop)."""
    free = np.float32(1) if is_direct else np.float32(0)
    for p in range(start, stop):
        if face[p] < 0:
            hides[p] = 0
            for channel in range(3):
                out[p, channel] = free * behind[p, channel]
        elif not is_catcher[face_material[face[p]]]:
            hides[p] = 1
        else:
            hides[p] = 1
            for channel in range(3):
                arrives, is_lit = np.float32(0), gain[channel] > 0
                for k in range(3):
                    of_vertex = unhidden[vertex[p, k], channel]
                    arrives += weight[p, k] * of_vertex
                    is_lit &= of_vertex > 0
                # beside the rim of a cone, what surfaces reflect would be held against next to nothing
                share = min(out[p, channel] / (gain[channel] * arrives), _MOST) if is_lit else free
                out[p, channel] = share * behind[p, channel]
                hides[p] -= luminance[channel] * min(share, np.float32(1))


def alpha_of(hides: F32, *, for_display: bool) -> F32:
    """Tell how much pixels hide of display values (sRGB) behind them, or of linear ones. hides: from `lay_over`."""
    return np.asarray(1 - srgb_encode(1 - hides), np.float32) if for_display else hides
