"""Match a look to strokes over its image, to a reference picture, or to both."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.image_io.downsample import downsample
from relume.inverse_lighting.match_lights import Match, match_lights
from relume.inverse_lighting.match_materials import match_materials
from relume.inverse_lighting.painting import PaintedTarget, Stroke, painted_target
from relume.inverse_lighting.reference_picture import match_exposure, read_reference
from relume.inverse_lighting.rotation import best_rotation
from relume.inverse_lighting.solve import RIDGE, Target, average_blocks
from relume.inverse_lighting.sources import (
    ENVIRONMENT_POINTER,
    LOCKED_POINTER,
    RenderLook,
    Sources,
    load_sources,
    pointer_of,
    replace_operations,
)
from relume.look import Look

F32 = NDArray[np.float32]
REFERENCE_RIDGE = 1e-6
"""λ for a picture: its pixels tell apart what a stroke leaves open."""
_REFERENCE_BLOCK = 4
"""Side of the blocks of pixels that are averaged if there is a reference picture: pixels of small images are samples of
the image, those of a reference picture averages, and at edges and highlights they would differ by 20 %."""
_MAX_RATIO = 2.0  # of the averages of samples and pixels
Size = tuple[int, int]
MakeStrokes = Callable[[Size], Sequence[Stroke]]


@dataclass(frozen=True)
class MatchRequest:
    """A target, and the fields of a look that may change.

    Attributes:
        strokes: makes the strokes for an image of a width and a height. reference: contents of a picture's file.
        fits_exposure: the reference picture is scaled to the image's mean luminance.
        locked: JSON pointers of lights that stay. changes_color: colors of lights may change.
        rotates: the environment may rotate, unless it is locked. materials: names of those that may change.
    """

    strokes: MakeStrokes = lambda size: ()
    reference: bytes | None = None
    fits_exposure: bool = False
    locked: frozenset[str] = frozenset()
    changes_color: bool = True
    rotates: bool = False
    materials: frozenset[str] = frozenset()


@dataclass(frozen=True)
class LookMatch:
    """A matched look.

    Attributes:
        operations: those of a JSON Patch on a complete look; they replace all terms of a material that changes.
        materials: names of the changed materials. match: the report.
    """

    operations: list[dict[str, Any]]
    materials: tuple[str, ...]
    match: Match


def match_look(
    look: Look, render: RenderLook, render_whole: RenderLook, size: Size, request: MatchRequest
) -> LookMatch:
    """Find the lights, and the materials by request, with which the image of a look is nearest to a target.

    Args:
        look: the current look. render: renders small images of looks. size: width and height of these images.
        render_whole: renders images of any size, of which the small ones are samples; once, for a reference picture.
        request: the target.
    Raises:
        EditError: the look's image is not linear in its lights. SceneError: the reference picture cannot be read.
        ParameterError: the request does not fit the look.
    """
    picture = None if request.reference is None else read_reference(request.reference, look.display, size)
    if picture is not None:
        render = _averaged(render, picture.weights)
    load = partial(load_sources, render=render, locked=request.locked)
    sources = load(look)
    before = sources.image(sources.strengths)
    reference = None if picture is None else _as_sampled(picture, before, downsample(render_whole(look)[..., :3], size))
    painted = _painted(before, request, reference)
    ridge = RIDGE if request.reference is None else REFERENCE_RIDGE

    def match(sources: Sources) -> Match:
        return match_lights(
            sources, painted, {LOCKED_POINTER}, changes_color=request.changes_color, ridge=ridge, before=before
        )

    def error(rotation: float) -> float:
        return match(load(_rotated(look, rotation))).error

    after = look
    if request.rotates and ENVIRONMENT_POINTER not in request.locked and painted.marked.any():
        after = _rotated(look, best_rotation(error, look.environment.rotation))
    if request.materials and painted.marked.any():
        after = match_materials(after, request.materials, render, load, painted.target, match, ridge)
    return _look_match(look, after, match(load(after)))


def _as_sampled(picture: Target, samples: F32, pixels: F32) -> Target:
    """Return averages of a picture as samples would show it: times the ratio of both for the current look.

    The ratio is at most two. It takes away half of the difference, since textures, edges and shadows remain in place.

    Args:
        picture: averages over pixels. samples: averages over blocks of samples of the current look.
        pixels: averages over pixels of its image.
    """
    averaged = picture.averaged(_REFERENCE_BLOCK)
    mean = average_blocks(pixels, picture.weights, _REFERENCE_BLOCK)
    least = 1e-3 * mean.mean() + 1e-12
    ratio = np.clip((samples + least) / (mean + least), 1 / _MAX_RATIO, _MAX_RATIO)
    return replace(averaged, radiance=np.asarray(averaged.radiance * ratio, np.float32))


def _averaged(render: RenderLook, weights: F32) -> RenderLook:
    """Return a function that renders images of averaged blocks."""
    return lambda look: average_blocks(render(look), weights, _REFERENCE_BLOCK)


def _look_match(look: Look, after: Look, match: Match) -> LookMatch:
    """Return the changes from a look to another one, besides those of its lights."""
    rotation = after.environment.rotation
    rotated = {} if rotation == look.environment.rotation % 360 else {ENVIRONMENT_POINTER: {"rotation": rotation}}
    names = tuple(name for name, material in after.materials.items() if material.terms != look.materials[name].terms)
    terms = {pointer_of("materials", name): after.materials[name].model_dump(include={"terms"}) for name in names}
    operations = [op for changes in (rotated, terms, match.changes) for op in replace_operations(changes)]
    return LookMatch(operations, names, match)


def _rotated(look: Look, rotation: float) -> Look:
    environment = look.environment.model_copy(update={"rotation": rotation})
    return look.model_copy(update={"environment": environment})


def _painted(image: F32, request: MatchRequest, reference: Target | None) -> PaintedTarget:
    strokes = request.strokes(_size(image))
    if request.fits_exposure and reference is not None:
        marks = [stroke.mask for stroke in strokes if stroke.kind == "reference"]
        weights = np.max(marks, axis=0) if marks else np.ones(image.shape[:2], np.float32)
        reference = match_exposure(reference, image, weights)
    return painted_target(strokes, image, reference)


def _size(image: F32) -> Size:
    return image.shape[1], image.shape[0]
