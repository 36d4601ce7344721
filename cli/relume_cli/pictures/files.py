"""Files of rendered images."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from relume.core.errors import ParameterError, PlanError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from relume.output.exr.layers import Layering

FORMATS = (".exr", ".png", ".webp")


class ExrOptions(NamedTuple):
    """Options for EXR only: layers (`relume.output.exr.layers`), AOVs, precision, and linear color space."""

    layering: Layering = False
    aovs: bool = False
    precision: Literal["half", "float"] = "half"
    color_space: str | None = None


def exr_options(
    output: Path, *, layers: bool, light_groups: bool, aovs: bool, full_float: bool, color_space: str | None
) -> ExrOptions:
    """Collect the EXR options. Raises ParameterError for other formats, and for options that exclude each other."""
    if layers and light_groups:
        raise PlanError("--layers and --light-groups exclude each other; give one")
    if (layers or light_groups or aovs or full_float or color_space) and output.suffix.lower() != ".exr":
        allowed = "a file name that ends in .exr, for --layers, --light-groups, --aovs, --float, --color-space"
        raise ParameterError("--output", str(output), allowed)
    return ExrOptions("light_groups" if light_groups else layers, aovs, "float" if full_float else "half", color_space)


def check_output(path: Path) -> None:
    """Raise ParameterError before hours of work if the image cannot be written."""
    if path.suffix.lower() not in FORMATS:
        raise ParameterError("--output", str(path), f"a file name that ends in {', '.join(FORMATS)}")
    if not path.parent.is_dir():
        raise ParameterError("--output", str(path), "a file in a folder that exists")


def check_display_view(path: Path, look: Any) -> None:
    """Raise ParameterError before hours of work if a look has a view that is not in the OpenColorIO config."""
    from relume.image_io.ocio.active_config import require_config
    from relume.image_io.ocio.view import OcioView

    if path.suffix.lower() != ".exr" and isinstance(look.display.tone_map, OcioView):
        require_config().check_view(look.display.tone_map)


def save(path: Path, image: NDArray[Any], look: Any) -> None:
    """Write linear radiance, (H, W, 3); display formats apply exposure and tone mapping of the look."""
    from relume.image_io.write_image import write_image

    write_image(path, image, look.display.transform)
