"""Requests of batches: saved looks are read, and views, looks and formats fit together."""

from __future__ import annotations

import json
from typing import Any

from relume.core.errors import Description, ParameterError, bytes_text
from relume.output.contact_sheet import MAX_IMAGES
from relume_server.persistence.look_store import LookStore, check_name
from relume_server.schemas.renders import MAX_FRAMES, MAX_LOOKS, CameraPath, QueuedRender, RenderRequest


def resolve_looks(request: RenderRequest, store: LookStore, max_bytes: int) -> QueuedRender:
    """Read the saved looks of a request, and name all looks; later changes of saved looks do not matter.

    Args:
        request: as received. store: of saved looks. max_bytes: upper bound of their documents.
    Raises:
        ParameterError: there is no look, or there are too many or too large ones. NotFoundError: one does not exist.
    """
    num_looks = len(request.looks) + len(request.saved_looks)
    if not 1 <= num_looks <= MAX_LOOKS:
        value = Description(f"a list of {num_looks} looks, with saved_looks")
        raise ParameterError("/looks", value, f"1 to {MAX_LOOKS:,} looks")
    if len(request.look_names) > len(request.looks):
        value = Description(f"a list of {len(request.look_names)} names")
        raise ParameterError("/look_names", value, f"at most one per look, {len(request.looks)} in total")
    names = [check_name(name) for name in request.saved_looks]
    documents = _saved_documents(names, store, max_bytes)
    unnamed = range(len(request.look_names), len(request.looks))
    own_names = [*request.look_names, *("default" if not request.looks[k] else f"look-{k}" for k in unnamed)]
    fields = {**dict(request), "looks": [*request.looks, *documents], "look_names": [*own_names, *names]}
    return QueuedRender.model_construct(**fields)


def _check_saved_views(request: QueuedRender) -> None:
    if request.views:
        raise ParameterError("/views", Description("a list of views"), "none with saved_views")
    if request.is_animation or request.format == "mp4":
        raise ParameterError("/saved_views", True, "false for animations, or one image of each look")


def _saved_documents(names: list[str], store: LookStore, max_bytes: int) -> list[dict[str, Any]]:
    documents, num_bytes = [], 0
    for name in names:
        text = store.get(name).document
        num_bytes += len(text)
        if num_bytes > max_bytes:
            value = Description(f"a list of looks with more than {bytes_text(max_bytes)}")
            raise ParameterError("/saved_looks", value, "fewer of them, in several renders")
        documents.append(json.loads(text))
    return documents


def look_pointers(request: QueuedRender) -> list[str]:
    """JSON pointers of all looks in the request as it was received."""
    num_own = len(request.looks) - len(request.saved_looks)
    return [
        *(f"/looks/{k}" for k in range(num_own)),
        *(f"/saved_looks/{k}" for k in range(len(request.saved_looks))),
    ]


def check_views(request: QueuedRender) -> None:
    """Check that a batch has views, and that all its parts are of a batch with so many. Raises ParameterError."""
    if request.saved_views:
        _check_saved_views(request)
    elif (request.view is None) == (not request.views):
        value = None if request.view is None else request.view
        raise ParameterError("/view", value, "either view, or a list of views")
    if len(request.views) > 1 and request.format == "mp4":
        raise ParameterError("/format", "mp4", "one view, because a video has one")
    if len(request.views) > 1 and isinstance(request.path, CameraPath):
        value = Description(f"a list of {len(request.views)} views")
        raise ParameterError("/views", value, "one view, because the cameras of path are those of one")
    if request.rebake and request.size is None:
        raise ParameterError("/size", None, "the size to bake")
    if request.frame_step > 1 and not request.is_animation:
        raise ParameterError("/frame_step", request.frame_step, "1, or frames or path for an animation")
    limit = MAX_IMAGES if request.format == "contact_sheet" else MAX_FRAMES
    if request.num_images > limit:
        value = Description(f"{request.num_images:,} images in {len(request.bake_views)} views")
        raise ParameterError("/frames", value, f"at most {limit:,} images in total")
