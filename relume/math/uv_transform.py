"""Affine transforms of texture coordinates, as those of glTF's KHR_texture_transform.

    (u', v') = A (u, v) + offset,  A = | cos θ   sin θ | | s_u  0  |
                                       | −sin θ  cos θ | |  0  s_v |

with v from the top. A scale of 2 repeats an image twice as often; a positive angle θ rotates it clockwise on a surface.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


class UvTransform(NamedTuple):
    """A transform of texture coordinates: scale, then rotation, then offset.

    Attributes:
        offset: of u and v. rotation: θ, radians. scale: of u and v; negative ones mirror.
    """

    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)

    @property
    def matrix(self) -> Shaped[F64, "2 2"]:
        """The linear part A."""
        cosine, sine = np.cos(self.rotation), np.sin(self.rotation)
        return np.asarray(np.array([[cosine, sine], [-sine, cosine]]) * np.array(self.scale))

    @property
    def side_factor(self) -> float:
        """Factor of the side of a square of equal area, √|det A|."""
        return float(np.sqrt(abs(self.scale[0] * self.scale[1])))

    @property
    def is_mirrored(self) -> bool:
        """True if the transform mirrors images."""
        return self.scale[0] * self.scale[1] < 0

    @property
    def tangent_angle(self) -> float:
        """Angle from the u axis to the transformed one, from u toward v, radians."""
        return float(np.arctan2(np.sin(self.rotation) / self.scale[1], np.cos(self.rotation) / self.scale[0]))

    @property
    def translation_from_bottom(self) -> tuple[float, float]:
        """The offset of the same transform with v from the bottom, where positive rotations are counterclockwise."""
        (_, sine_v), (_, cosine_v) = self.matrix.tolist()
        return self.offset[0] + sine_v, 1 - self.offset[1] - cosine_v

    def points(self, uv: Shaped[F32, "n 2"]) -> Shaped[F32, "n 2"]:
        """Transform texture coordinates."""
        turned = UvTransform(rotation=self.rotation).matrix
        return np.asarray((uv * np.array(self.scale)) @ turned.T + np.array(self.offset), np.float32)

    def footprints(self, uv: Shaped[F32, "n uv"]) -> Shaped[F32, "n uv"]:
        """Transform texture coordinates with the footprints of pixels, and the direction of the u axis.

        Args:
            uv: as in `relume.raytrace.surface_interaction.SurfaceInteraction`; older stores lack the sides.
        """
        out = uv.copy()
        out[:, :2] = self.points(uv[:, :2])
        out[:, 2] *= self.side_factor
        out[:, 3] -= uv[:, 4] * np.float32(self.tangent_angle)  # v runs down
        out[:, 4] *= -1 if self.is_mirrored else 1
        out[:, 5:] = (uv[:, 5:].reshape(-1, 2) @ self.matrix.T).reshape(len(uv), -1)
        return out

    def normals(self, mapped: Shaped[F32, "*batch 3"]) -> Shaped[F32, "*batch 3"]:
        """Transform tangent-space normals of a transformed image to the frame of the coordinates before the transform.

        Args:
            mapped: x along u, y against v.
        """
        cosine, sine = np.cos(self.tangent_angle), np.sin(self.tangent_angle)
        x, y, z = np.moveaxis(mapped, -1, 0)
        if self.is_mirrored:
            y = -y
        return np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=-1).astype(np.float32)

    def tangents(self, tangents: Shaped[F32, "n 4"], normals: Shaped[F32, "n 3"]) -> Shaped[F32, "n 4"]:
        """Rotate tangents about normals to the transformed u axis.

        Args:
            tangents: along u, with the sign of the bitangent, which runs against v. normals: unit.
        """
        cosine, sine = np.cos(self.tangent_angle), np.sin(self.tangent_angle)
        bitangent = tangents[:, 3:] * np.cross(normals, tangents[:, :3])
        sign = tangents[:, 3] * (-1 if self.is_mirrored else 1)
        return np.column_stack([cosine * tangents[:, :3] - sine * bitangent, sign]).astype(np.float32)
