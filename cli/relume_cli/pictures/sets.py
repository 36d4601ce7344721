"""Sets: saved looks that are rendered in their own views."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from relume.core.errors import Description, NotFoundError, ParameterError
from relume.output.file_names import FileFields, file_names, parse_template
from relume_cli.pictures.plans import PlannedFile
from relume_cli.terminal.printing import note

if TYPE_CHECKING:
    from relume_cli.pictures.looks import NamedLook
    from relume_cli.pictures.plans import AnimationPlan
    from relume_cli.pictures.write_images import RenderSource
    from relume_server.schemas.renders import QueuedRender


def check_sets(
    looks: Sequence[str] | None,
    views: Sequence[str] | None,
    animation_plan: AnimationPlan | None,
    *,
    saved_views: bool,
    all_sets: bool,
) -> None:
    """Raise ParameterError for options that exclude each other."""
    if all_sets and looks:
        raise ParameterError("--all-sets", True, "it without --look, or --saved-views")
    if (saved_views or all_sets) and animation_plan is not None:
        raise ParameterError("--saved-views", True, "it without --turntable and --frames")
    if (saved_views or all_sets) and len(views or ()) > 1:
        value = Description(f"a list of {len(views or ())} views")
        raise ParameterError("--view", value, "at most one, for looks without a view")


def select_sets(source: RenderSource, looks: Sequence[NamedLook]) -> list[NamedLook]:
    """Return the looks that fit the scene of a bake, since saved looks are those of all scenes; note the others.

    Raises:
        NotFoundError: none fits.
    """
    from relume_cli.data_folder import complete_look

    fitting = []
    for look in looks:
        try:
            complete_look(look.document, source.transfer.default_look, look.name)
        except ParameterError as error:
            note(f"note: the set {look.name!r} is not of this scene: {error}")
        else:
            fitting.append(look)
    if not fitting:
        raise NotFoundError(f"no saved look with a view fits the scene {source.scene.name!r}")
    return fitting


def resolve_sets(source: RenderSource, looks: Sequence[NamedLook]) -> QueuedRender:
    """Return a batch of looks in their views. Raises ParameterError if the bake does not have a view or pose."""
    from relume_server.batch.saved_views import use_saved_views
    from relume_server.schemas.renders import QueuedRender

    batch = QueuedRender(bake=source.bake.id, view=source.view, format="png")
    batch.looks, batch.look_names = [look.document for look in looks], [look.name for look in looks]
    use_saved_views(batch, [look.view for look in looks], source.transfer)
    return batch


def plan_sets(source: RenderSource, batch: QueuedRender, output: Path, fields: FileFields) -> list[PlannedFile]:
    """Assign a file to each look. Raises ParameterError if two images would be written to one file."""
    from relume_server.batch.frame_sequence import cameras_of

    named = list(enumerate(zip(batch.look_views, batch.look_names, strict=True)))
    files = [fields._replace(view=view, look=look, frame=fields.frame + k) for k, (view, look) in named]
    names = file_names(parse_template("--output", output.name), files)
    cameras = cameras_of(batch, source.view, source.transfer)
    return [
        PlannedFile(look, (document,), view, output.with_name(name), camera=camera)
        for (_, (view, look)), document, name, camera in zip(named, batch.looks, names, cameras, strict=True)
    ]
