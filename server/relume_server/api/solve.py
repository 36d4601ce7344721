"""/api/solve: lights that are found from strokes over an image, or from a reference picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from fastapi import APIRouter
from fastapi.concurrency import run_in_threadpool
from PIL import Image

from relume import look as looks
from relume.core.errors import ParameterError
from relume.image_io.decode import Decoder
from relume.inverse_lighting.match_look import LookMatch, MatchRequest, match_look
from relume.inverse_lighting.painting import Stroke, brush_mask
from relume.inverse_lighting.sources import merge_changes
from relume.live.fixed_camera.protocols import CameraMode, OpenBake
from relume.look.light_mix import expand_light_mix
from relume_server.api.bakes import require_ready_bake
from relume_server.api.renders import baked_view, check_look, check_picture_size
from relume_server.runtime.protocols import F32, Library
from relume_server.schemas.message import PatchOperation
from relume_server.schemas.solve import ShortfallBody, SolveBody, SolveRequest, SourceChange, StrokeBody
from relume_server.services import ServicesDep

router = APIRouter(prefix="/api/solve", tags=["looks"])
IMAGE_WIDTH = 160
"""Width of the images of single lights, pixels: lights change slowly over an image, and a stroke waits for them."""


@router.post("", name="solve_look")
async def solve(request: SolveRequest, services: ServicesDep) -> SolveBody:
    """Return the look whose lights, and materials by request, come nearest to a target. The first call for a view
    renders an image of each light; without strokes and reference it does nothing else.
    """
    await run_in_threadpool(require_ready_bake, services, request.bake)
    async with services.transfers.acquire(request.bake, services.bakes.store_path(request.bake)) as transfer:
        return await run_in_threadpool(solve_request, request, transfer, services.live.library)


def solve_request(request: SolveRequest, transfer: OpenBake, library: Library) -> SolveBody:
    """Solve a request with an opened bake.

    Raises:
        ParameterError: the request does not fit the bake. SceneError: a picture cannot be read. EditError: the image is
            not linear in the lights.
    """
    check_look(request.look, transfer, "/look")
    look = looks.validate(request.look, transfer.default_look)
    camera_and_size, size = _camera(request, transfer)
    small_size, render = library.small_renderer(transfer, request.view, IMAGE_WIDTH, camera_and_size)
    _, render_whole = library.small_renderer(transfer, request.view, size[0], camera_and_size)
    reference = request.reference
    match = match_look(
        look,
        render,
        render_whole,
        small_size,
        MatchRequest(
            strokes=lambda small: _make_strokes(request.strokes, size, small),
            reference=None if reference is None else reference.image,
            fits_exposure=reference is not None and reference.fit_exposure,
            locked=frozenset(request.locked),
            changes_color=_changes_color(request),
            rotates=request.rotate,
            materials=frozenset(request.materials),
        ),
    )
    return _body(request, transfer, match)


def _camera(request: SolveRequest, transfer: OpenBake) -> tuple[Any, tuple[int, int]]:
    """Camera and size for the renderer, None for a fixed camera; and the size of the image with the strokes."""
    view = baked_view(request.view, transfer)
    baked_size = view.width, view.height
    if transfer.camera_mode is not CameraMode.FREE:
        if request.camera is not None or request.size not in (None, baked_size):
            allowed = f"none: the bake has fixed cameras of {view.width}×{view.height}"
            raise ParameterError("camera", "given", allowed)
        return None, baked_size
    check_picture_size(request.size)
    camera = view.camera if request.camera is None else request.camera.custom_camera(request.view).camera
    size = request.size or baked_size
    return (camera, size), size


def _changes_color(request: SolveRequest) -> bool:
    if request.change is not None:
        return request.change == "color"
    return not request.strokes or any(stroke.kind in ("color", "reference") for stroke in request.strokes)


def _make_strokes(strokes: Sequence[StrokeBody], size: tuple[int, int], small: tuple[int, int]) -> list[Stroke]:
    """Draw strokes over an image at the size of a small one."""
    scale, decoder = (small[0] / size[0], small[1] / size[1]), Decoder()
    return [Stroke(each.kind, _mask(each, scale, small, decoder), each.stops, each.color) for each in strokes]


def _mask(stroke: StrokeBody, scale: tuple[float, float], small: tuple[int, int], decoder: Decoder) -> F32:
    if stroke.mask is not None:
        gray = Image.fromarray(decoder.decode_gray(stroke.mask, "the mask of a stroke"))
        return np.clip(np.asarray(gray.resize(small, Image.Resampling.BOX), np.float32), 0.0, 1.0)
    points = [(x * scale[0], y * scale[1]) for x, y in stroke.points]
    return brush_mask(points, stroke.radius * scale[0], small)


def _body(request: SolveRequest, transfer: OpenBake, solved: LookMatch) -> SolveBody:
    match, has_strokes = solved.match, bool(request.strokes)
    partial, _ = expand_light_mix(request.look, transfer.default_look)  # which has no materials
    return SolveBody(
        patch=[PatchOperation(**operation) for operation in solved.operations],
        look=merge_changes(partial, solved.operations),
        residual=match.residual,
        residual_before=match.residual_before,
        changes=[SourceChange(pointer=pointer, stops=stops) for pointer, stops in match.stops.items()],
        materials=list(solved.materials),
        shortfalls=[
            ShortfallBody.from_object(each, stroke=each.region if has_strokes else None) for each in match.shortfalls
        ],
    )
