"""Names of the images of a batch: of files, and on contact sheets."""

from __future__ import annotations

from collections.abc import Mapping

from relume.output.file_names import FileFields, FileTemplate, file_names, parse_portable_template, safe_stem
from relume_server.schemas.renders import QueuedRender


def name_images(request: QueuedRender, scene_names: Mapping[str, str]) -> list[str]:
    """Return the file name of each image of a batch.

    Args:
        request: with names of all looks. scene_names: name of the scene of each bake.
    Raises:
        ParameterError: `file_name` is invalid, or two images would have the same name.
    """
    return file_names(_template(request), [_fields(request, scene_names, k) for k in range(request.num_images)])


def label_images(request: QueuedRender) -> list[str]:
    """Return the label of each image on a contact sheet: those of look, view and frame that differ."""
    labels = []
    for index in range(request.num_images):
        bake, view, frame = request.image(index)
        texts = [_look_name(request, frame)]
        if len(request.views) > 1:
            texts += [view, bake] if len({bake for bake, _ in request.bake_views}) > 1 else [view]
        if not _has_look_per_frame(request):
            texts.append(f"frame {request.start_frame + frame}")
        labels.append(", ".join(texts))
    return labels


def _template(request: QueuedRender) -> FileTemplate:
    suffix = f".{request.picture_format}"
    if request.file_name is not None:
        return parse_portable_template("/file_name", request.file_name, suffix)
    text = safe_stem(request.name or request.view or "picture")
    if len({bake for bake, _ in request.bake_views}) > 1:
        text += "-{bake}"
    if len(request.bake_views) > 1:
        text += "-{view}"
    if len(request.frame_indices) > 1:
        text += "-{frame:04}"
    return parse_portable_template("/file_name", text, suffix)


def _fields(request: QueuedRender, scene_names: Mapping[str, str], index: int) -> FileFields:
    bake, view, frame = request.image(index)
    return FileFields(scene_names[bake], bake, view, _look_name(request, frame), request.start_frame + frame)


def _look_name(request: QueuedRender, frame: int) -> str:
    """Name of the look of a frame; of an animation from look to look, the first and last."""
    if _has_look_per_frame(request):
        return request.look_names[frame]
    return " to ".join(dict.fromkeys((request.look_names[0], request.look_names[-1])))


def _has_look_per_frame(request: QueuedRender) -> bool:
    """True if each frame is one of the looks."""
    return len(request.looks) == request.num_frames and request.durations is None
