"""A moment of the animations: the transforms and morph weights of nodes at one time.

    LINEAR       v = (1 − s) v_k + s v_{k+1};  slerp(v_k, v_{k+1}, s) for rotations
    CUBICSPLINE  v = (2s³ − 3s² + 1) v_k + (s³ − 2s² + s) Δ b_k + (3s² − 2s³) v_{k+1} + (s³ − s²) Δ a_{k+1}

for s = (t − t_k) / Δ, Δ = t_{k+1} − t_k, in-tangents a and out-tangents b. Values are constant before the first and
after the last keyframe. glTF 2.0 specification, section 3.11 and appendix C.
"""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, ignored, quote, unsupported
from relume.scene_io.gltf.accessors import AccessorReader
from relume.scene_io.gltf.document import MAX_WEIGHTS, Animation, AnimationSampler, Document

F64 = NDArray[np.float64]
POINTER = "KHR_animation_pointer"
_WIDTHS = {"translation": 3, "rotation": 4, "scale": 3, "weights": 1}
_MAX_LISTED = 10
_NEARLY_EQUAL = 0.9995  # cosine of the angle between rotations, whose slerp would divide by almost zero


def pose_nodes(document: Document, time: float, accessors: AccessorReader, warnings: list[ImporterWarning]) -> None:
    """Set the nodes of a document to a moment of its animations.

    Exporters write one animation for each object, or several of one object, such as walking and running. All that move
    different properties apply; of those that move the same ones, the first.

    Args:
        document: of the file; its nodes change. time: seconds. accessors: of the file.
        warnings: gets a sentence about the animations, and one for each kind of channel that cannot be read.
    """
    if not len(document.animations):
        warnings.append(ignored(f"The file has no animation; its time of {time:g} s has no effect."))
        return
    moved = dict[tuple[int, str], str]()
    shown, first, last = list[str](), inf, -inf
    for index in range(len(document.animations)):
        label = document.animations.label(index)
        try:
            animation = document.animations.get(index)
        except SceneError as problem:
            warnings.append(unsupported(f"Objects aren't moved by {label}: {problem}."))
            continue
        channels = ((channel.target.node, channel.target.path) for channel in animation.channels)
        targets = {(node, path) for node, path in channels if node is not None}
        earlier = next((moved[target] for target in sorted(targets & moved.keys())), None)
        if earlier is not None:
            warnings.append(ignored(f"Objects aren't moved by {label}: {earlier} moves the same ones."))
            continue
        moved |= dict.fromkeys(targets, label)
        pose = _Pose(document, animation, label, accessors, warnings)
        pose.set(time)
        shown.append(label)
        first, last = min(first, pose.first), max(last, pose.last)
    if shown:
        names = ", ".join(shown[:_MAX_LISTED]) + (
            f" and {len(shown) - _MAX_LISTED:,} more" * (len(shown) > _MAX_LISTED)
        )
        duration = f", which lasts from {first:g} to {last:g} s" if time < first < inf or time > last > -inf else ""
        warnings.append(ignored(f"Objects are shown at {time:g} s of {names}{duration}."))


class _Pose:
    """Sets the targets of one animation. first, last: times of its keyframes, seconds; ±inf before any is read"""

    def __init__(
        self,
        document: Document,
        animation: Animation,
        label: str,
        accessors: AccessorReader,
        warnings: list[ImporterWarning],
    ) -> None:
        self._document, self._animation, self._accessors, self._warnings = document, animation, accessors, warnings
        self._label = label
        self._times: dict[int, F64] = {}
        self.first, self.last = inf, -inf

    def set(self, time: float) -> None:
        """Set the target of each channel."""
        pointers, faults = 0, list[str]()
        for channel in self._animation.channels:
            if channel.target.path == "pointer":
                pointers += 1
                continue
            try:
                self._set_target(channel.target.node, channel.target.path, self._sampler(channel.sampler), time)
            except SceneError as problem:
                faults.append(str(problem))
        if pointers:
            message = f"Values that {self._label} changes by {POINTER} were ignored ({pointers:,}): not supported."
            self._warnings.append(unsupported(message))
        if faults:
            more = f" ({len(faults) - 1:,} more)" if len(faults) > 1 else ""
            message = f"A channel of {self._label} was left out: {faults[0]}{more}."
            self._warnings.append(unsupported(message))

    def _sampler(self, index: int) -> AnimationSampler:
        if not 0 <= index < len(self._animation.samplers):
            number = str(index)[:20]
            raise SceneError(
                f"it refers to sampler {number} of {len(self._animation.samplers)}; export the scene again"
            )
        return self._animation.samplers[index]

    def _set_target(self, index: int | None, path: str, sampler: AnimationSampler, time: float) -> None:
        """Set a property of a node. Raises SceneError."""
        if index is None:
            return  # the target of an unknown extension, as the specification says
        if path not in _WIDTHS:
            raise SceneError(f"it animates {quote(path)}, which glTF doesn't have; export the scene again")
        node = self._document.nodes.get(index, self._label)
        if node.matrix is not None and path != "weights":
            raise SceneError(
                f"{self._document.nodes.label(index)} has a matrix; export its translation, rotation, scale"
            )
        value = self._value(sampler, path, time).tolist()
        self._document.nodes.replace(index, node.model_copy(update={path: tuple(value)}))

    def _value(self, sampler: AnimationSampler, path: str, time: float) -> F64:
        """Value of a channel. Raises SceneError."""
        times = self._read_times(sampler.input)
        rows = 3 if sampler.interpolation == "CUBICSPLINE" else 1
        output = self._accessors.floats(sampler.output, (_WIDTHS[path],), f"keyframes of {path}")
        num_values, remainder = divmod(len(output), rows * len(times))
        if remainder or not 1 <= num_values <= (MAX_WEIGHTS if path == "weights" else 1):
            raise SceneError(
                f"its {path} has {len(output):,} values for {len(times):,} keyframes; export the scene again"
            )
        keyframes = output.reshape(len(times), rows, -1)
        value = interpolate(times, keyframes, time, sampler.interpolation, is_rotation=path == "rotation")
        if not np.isfinite(value).all():
            raise SceneError(f"its {path} is not finite; export the scene again")
        return value

    def _read_times(self, index: int) -> F64:
        if index not in self._times:
            times = self._accessors.floats(index, (1,), "times of keyframes")[:, 0].astype(np.float64)
            if not len(times) or not np.isfinite(times).all() or (np.diff(times) < 0).any():
                raise SceneError("the times of its keyframes are missing, not finite, or not ascending")
            self._times[index] = times
            self.first, self.last = min(self.first, float(times[0])), max(self.last, float(times[-1]))
        return self._times[index]


def interpolate(
    times: Shaped[F64, " keyframes"],
    keyframes: Shaped[NDArray[np.float32], "keyframes rows width"],
    time: float,
    interpolation: str,
    *,
    is_rotation: bool,
) -> Shaped[F64, " width"]:
    """Value of a sampler at a time.

    Args:
        times: ascending, seconds. keyframes: values; with CUBICSPLINE in-tangent, value and out-tangent of each.
        interpolation: "STEP", "LINEAR" or "CUBICSPLINE".
        is_rotation: whether values are unit quaternions, as x, y, z, w.
    """
    values = keyframes[:, keyframes.shape[1] // 2]
    k = int(np.searchsorted(times, time, side="right")) - 1
    if k < 0 or k == len(times) - 1 or interpolation == "STEP":
        return np.asarray(values[max(k, 0)], np.float64)
    duration = float(times[k + 1] - times[k])
    s = float(time - times[k]) / duration
    a, b = values[k : k + 2].astype(np.float64)
    if interpolation == "LINEAR":
        return _slerp(a, b, s) if is_rotation else np.asarray((1 - s) * a + s * b)
    out_tangent, in_tangent = keyframes[k, 2] * duration, keyframes[k + 1, 0] * duration
    basis = np.array([2 * s**3 - 3 * s**2 + 1, s**3 - 2 * s**2 + s, 3 * s**2 - 2 * s**3, s**3 - s**2])
    return np.asarray(basis @ np.stack([a, out_tangent, b, in_tangent]))


def _slerp(a: Any, b: Any, s: float) -> F64:
    """Spherical linear interpolation along the shorter arc."""
    cosine = float(a @ b)
    a, cosine = (a, cosine) if cosine >= 0 else (-a, -cosine)
    if cosine > _NEARLY_EQUAL:
        return np.asarray((1 - s) * a + s * b)
    angle = np.arccos(cosine)
    return np.asarray((np.sin((1 - s) * angle) * a + np.sin(s * angle) * b) / np.sin(angle))
