"""Embree 4 through its C interface, for the packet calls that embreex's own wrapper does not offer.

The embreex wheel bundles the library. Numba kernels receive the addresses of its functions in a `PacketTracer` and call
them without the interpreter, with `PACKET_WIDTH` rays per call.
"""

from __future__ import annotations

import ctypes
import glob
import os
import weakref
from dataclasses import dataclass
from typing import NamedTuple

import embreex
import embreex.rtcore
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.raytrace.alpha_filter import FILTER, AlphaTest

_POINTER, _WORD = ctypes.c_void_p, ctypes.c_uint64
_TRIANGLE, _INDEX_BUFFER, _VERTEX_BUFFER, _UINT3, _FLOAT3 = 0, 0, 1, 0x5003, 0x9003
_COHERENT, _FEATURE_TRIANGLE = 1 << 16, 2
_BUILD_QUALITY_MEDIUM = 1
_NATIVE_RAY16 = 34  # RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED


def _open_library() -> ctypes.CDLL:
    folder = os.path.join(os.path.dirname(os.path.dirname(embreex.__file__)), "embreex.libs")
    library_paths = sorted(glob.glob(os.path.join(glob.escape(folder), "libembree4*")))
    if not library_paths:
        raise ImportError("the embreex wheel bundles no Embree library here; install embreex from a binary wheel")
    return ctypes.CDLL(library_paths[0])


_library = _open_library()


def _function(name: str, result: type | None, *arguments: type) -> ctypes._NamedFuncPointer:
    function = getattr(_library, name)
    function.restype, function.argtypes = result, arguments
    return function  # type: ignore[no-any-return]


_new_device = _function("rtcNewDevice", _POINTER, ctypes.c_char_p)
_release_scene = _function("rtcReleaseScene", None, _POINTER)
_release_geometry = _function("rtcReleaseGeometry", None, _POINTER)
_new_scene = _function("rtcNewScene", _POINTER, _POINTER)
_set_quality = _function("rtcSetSceneBuildQuality", None, _POINTER, ctypes.c_int)
_new_geometry = _function("rtcNewGeometry", _POINTER, _POINTER, ctypes.c_int)
_set_buffer = _function(
    "rtcSetNewGeometryBuffer",
    _POINTER, _POINTER, ctypes.c_int, ctypes.c_uint, ctypes.c_int, ctypes.c_size_t, ctypes.c_size_t,
)  # fmt: skip
_set_user_data = _function("rtcSetGeometryUserData", None, _POINTER, _POINTER)
_set_filters = [
    _function(f"rtcSetGeometry{call}FilterFunction", None, _POINTER, _POINTER) for call in ("Intersect", "Occluded")
]
_commit_geometry = _function("rtcCommitGeometry", None, _POINTER)
_attach_geometry = _function("rtcAttachGeometry", ctypes.c_uint, _POINTER, _POINTER)
_commit_scene = _function("rtcCommitScene", None, _POINTER)
_device_error = _function("rtcGetDeviceError", ctypes.c_int, _POINTER)

_device = _new_device(b"threads=1")
_property = _function("rtcGetDeviceProperty", ctypes.c_ssize_t, _POINTER, ctypes.c_int)

# Rays per packet: the SIMD width of this processor. Embree splits larger packets and traces them ray by ray.
PACKET_WIDTH = 16 if _property(_device, _NATIVE_RAY16) else 8


class PacketTracer(NamedTuple):
    """A trace call on a scene, for kernels.

    Attributes:
        function: address of rtcOccluded or rtcIntersect for `PACKET_WIDTH` rays. scene: `EmbreeScene.handle`.
        arguments: address of RTCOccludedArguments or RTCIntersectArguments.
    """

    function: int
    scene: int
    arguments: int


_occluded, _intersect = (
    ctypes.cast(getattr(_library, f"rtc{name}{PACKET_WIDTH}"), _POINTER).value or 0
    for name in ("Occluded", "Intersect")
)
# flags and feature mask, and three null pointers; incoherent rays, then coherent ones
_ARGUMENTS = np.zeros((2, 5), np.uint64)
_ARGUMENTS.view(np.uint32)[:, :2] = (0, _FEATURE_TRIANGLE), (_COHERENT, _FEATURE_TRIANGLE)


OMITTED_VERTEX = np.uint32(0xFFFFFFFF)  # an invalid index: Embree skips the triangle, the others keep their indices


@dataclass(frozen=True)
class EmbreeScene:
    """A committed Embree scene, released with this object. Kernels use `handle`."""

    handle: int
    alpha_test: AlphaTest | None = None

    @classmethod
    def build(
        cls,
        positions: Shaped[NDArray[np.float32], "vertices 3"],
        faces: Shaped[NDArray[np.uint32], "faces 3"],
        alpha_test: AlphaTest | None = None,
    ) -> EmbreeScene:
        """Build the acceleration structure.

        Args:
            positions: finite. faces: vertex indices.
            alpha_test: filter for the triangles that are not opaque; None if all are opaque.
        Raises:
            SceneError: Embree rejected the geometry.
        """
        scene = _new_scene(_device)
        _set_quality(scene, _BUILD_QUALITY_MEDIUM)
        if alpha_test is None:
            _attach(scene, positions, faces)
        else:
            is_alpha_tested = alpha_test.image[:, None] >= 0
            _attach(scene, positions, np.where(is_alpha_tested, OMITTED_VERTEX, faces))
            _attach(scene, positions, np.where(is_alpha_tested, faces, OMITTED_VERTEX), alpha_test)
        _commit_scene(scene)
        if error := _device_error(_device):
            raise SceneError(f"Embree could not build the scene (error {error}); check it for broken triangles")
        return cls(scene, alpha_test)

    def shadow_tracer(self, *, coherent: bool) -> PacketTracer:
        """Trace shadow rays. coherent: rays of a packet have similar directions."""
        return PacketTracer(_occluded, self.handle, _ARGUMENTS[int(coherent)].ctypes.data)

    def hit_tracer(self, *, coherent: bool) -> PacketTracer:
        """Find first hits; see `shadow_tracer`."""
        return PacketTracer(_intersect, self.handle, _ARGUMENTS[int(coherent)].ctypes.data)

    def __post_init__(self) -> None:
        weakref.finalize(self, _release_scene, self.handle).atexit = False


def _attach(
    scene: int, positions: NDArray[np.float32], faces: NDArray[np.uint32], alpha_test: AlphaTest | None = None
) -> None:
    """Add triangles to a scene, with `alpha_test` as the filter of their hits. Raises SceneError."""
    geometry = _new_geometry(_device, _TRIANGLE)
    for kind, layout, rows in (
        (_VERTEX_BUFFER, _FLOAT3, np.ascontiguousarray(positions, np.float32)),
        (_INDEX_BUFFER, _UINT3, np.ascontiguousarray(faces, np.uint32)),
    ):
        buffer = _set_buffer(geometry, kind, 0, layout, 12, len(rows))
        if not buffer:
            raise SceneError(f"Embree could not allocate {len(rows)} rows of geometry; use a smaller scene")
        ctypes.memmove(buffer, rows.ctypes.data, rows.nbytes)
    if alpha_test is not None:
        _set_user_data(geometry, alpha_test.addresses.ctypes.data)
        for set_filter in _set_filters:
            set_filter(geometry, FILTER)
    _commit_geometry(geometry)
    _attach_geometry(scene, geometry)
    _release_geometry(geometry)
