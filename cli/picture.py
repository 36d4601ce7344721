"""Writes pictures that commands made."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from numpy.typing import NDArray

from relume.errors import ParameterError

FORMATS = (".exr", ".png", ".webp")


def check_output(path: Path) -> None:
    """Raise ParameterError before hours of work where the picture could not be written."""
    if path.suffix.lower() not in FORMATS:
        raise ParameterError("--output", path.name, f"a file name that ends in {', '.join(FORMATS)}")
    if not path.parent.is_dir():
        raise ParameterError("--output", str(path), "a file in a folder that exists")


def check_shown(path: Path, look: Any) -> None:
    """Raise ParameterError before hours of work where a look has a view that no config here has."""
    from relume.imageio.ocio.current import needed
    from relume.imageio.ocio.view import OcioView

    if path.suffix.lower() != ".exr" and isinstance(look.display.tone_map, OcioView):
        needed().check_view(look.display.tone_map)


def save(path: Path, image: NDArray[Any], look: Any) -> None:
    """Write linear radiance, (H, W, 3); formats for the screen are shown as the look's display says."""
    from relume.imageio.files import write_image

    write_image(path, image, look.display.exposure, look.display.tone_map)


def save_exr(
    path: Path,
    transfer: Any,
    view: str,
    look: Any,
    origin: Any,
    layering: Any,
    precision: Literal["half", "float"],
    stills: Any = None,
    color_space: str | None = None,
) -> None:
    """Render a look, with the layers that are asked for, see `relume.exr.layers`, and say how far it is."""
    from rich.console import Console
    from rich.progress import Progress

    from relume.exr.attributes import attributes_of
    from relume.exr.layers import layers_for
    from relume.exr.picture import export_exr
    from relume.exr.space import space_called
    from relume.picture.transfer import Axis
    from relume.render.image import render_image

    of = transfer.views[view]
    layers = layers_for(layering, look, reflects=Axis.BOUNCES in transfer.axes)
    space = space_called(color_space)
    attributes = attributes_of(origin, of.camera, (of.width, of.height), look, layers, space)
    with Progress(console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task("render", total=1.0)
        export_exr(
            path,
            lambda shown, tell: render_image(transfer, view, shown, progress=tell, stills=stills),
            look,
            layers,
            attributes,
            precision,
            lambda share: progress.update(bar, completed=share),
            space,
        )
