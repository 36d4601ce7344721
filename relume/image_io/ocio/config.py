"""An OpenColorIO config: its views and color spaces for images, and their transforms.

The config and the files that it refers to belong to the operator. Clients name displays, views and color spaces; only
names that the config lists reach OpenColorIO, which fetches nothing from a network.
"""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import ParameterError
from relume.core.thread_pools import for_ranges
from relume.image_io.ocio.lut import LAYOUT, build_lut
from relume.image_io.ocio.view import OcioView

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

log = logging.getLogger(__name__)

_NAMES = (  # of linear Rec. 709: the interop id, then older names in configs
    "lin_rec709_scene", "lin_rec709", "lin_rec709_srgb", "lin_srgb",
    "Linear Rec.709 (sRGB)", "Linear Rec.709", "Utility - Linear - Rec.709", "Utility - Linear - sRGB",
)  # fmt: skip
_BUILT_IN, _BUILT_IN_SPACE = "ocio://cg-config-latest", "lin_rec709_scene"
_NUM_CACHED_TABLES = 8  # 1.6 MB each
_ROWS_PER_RANGE = 1 << 14


class Config:
    """A loaded and checked config.

    Attributes:
        name: the config's name, or its file name.
        id: hash of the config's contents and of the LUT layout. 16 hexadecimal digits
        working: the config's name of linear Rec. 709.
        displays: the views of each display, both in the config's order.
        default: the config's default view.
    """

    def __init__(self, source: str, working: str | None = None) -> None:
        """Load a config.

        Args:
            source: path of a .ocio or .ocioz file, or ocio://… of a built-in one.
            working: the config's name of linear Rec. 709; None: found by common names, then by its transform.
        Raises:
            ParameterError: the config cannot be used.
        """
        self._ocio = ocio = _module()
        self._config = _read_config(ocio, source)
        self.name = str(self._config.getName() or os.path.basename(source))
        fingerprint = f"{self._config.getCacheID()} {ocio.__version__} {LAYOUT}"
        self.id = hashlib.sha256(fingerprint.encode()).hexdigest()[:16]
        self.displays: Mapping[str, tuple[str, ...]] = {
            str(display): tuple(map(str, self._config.getViews(display))) for display in self._config.getDisplays()
        }
        display = str(self._config.getDefaultDisplay())
        self.default = OcioView(display, str(self._config.getDefaultView(display)))
        if not self.displays.get(display):
            raise ParameterError("RELUME_OCIO", source, "a config that has displays, and views of them")
        self.working = _working_space(ocio, self._config, working)
        self._table = lru_cache(_NUM_CACHED_TABLES)(self._build_table)
        try:
            self._processor(self._to_view(self.default))
        except _failures(ocio) as error:
            raise ParameterError(
                "RELUME_OCIO", source, f"a config whose default view works ({_error_text(error)})"
            ) from None

    @cached_property
    def spaces(self) -> tuple[str, ...]:
        """Linear color spaces of the config, for exported images."""
        spaces = [space for space in self._config.getColorSpaces() if not space.isData()]
        return tuple(str(space.getName()) for space in spaces if self._is_linear(space))

    def _is_linear(self, space: Any) -> bool:
        try:
            return bool(self._config.isColorSpaceLinear(space.getName(), self._ocio.REFERENCE_SPACE_SCENE))
        except _failures(self._ocio):  # it needs a file that is missing
            return False

    def check_view(self, view: OcioView) -> None:
        """Raise ParameterError unless the config has this view."""
        if view.display not in self.displays:
            raise ParameterError("display", view.display, f"one of {_join_names(self.displays)}")
        if view.view not in self.displays[view.display]:
            raise ParameterError("view", view.view, f"one of {_join_names(self.displays[view.display])}")

    def canonical_space(self, name: str) -> str:
        """Return the config's name of a linear color space.

        Args:
            name: name, alias, or role.
        Raises:
            ParameterError: the config has no such space.
        """
        canonical_name = str(self._config.getCanonicalName(name))
        if canonical_name not in self.spaces:
            raise ParameterError("color_space", name, f"a linear color space of the config: {_join_names(self.spaces)}")
        return canonical_name

    def apply_view(self, pixels: Shaped[F32, "n 3"], view: OcioView, *, use_table: bool = False) -> None:
        """Convert radiance to display values, in place.

        Args:
            pixels: linear Rec. 709, C-contiguous.
            use_table: use the view's LUT, as the editor does; takes a third of the time.
        Raises:
            ParameterError: the config has no such view, or it does not work.
        """
        self.check_view(view)
        if use_table:
            from relume.image_io.ocio.sampling import apply_lut  # compiled

            return apply_lut(self.table(view), pixels)
        return self._apply(self._to_view(view), pixels, f"the view {view.view!r} of {view.display!r}")

    def convert(self, pixels: Shaped[F32, "n 3"], space: str) -> None:
        """Convert radiance to another linear color space, in place.

        Args:
            pixels: linear Rec. 709, C-contiguous.
            space: from `canonical_space`.
        Raises:
            ParameterError: the conversion does not work.
        """
        transform = self._ocio.ColorSpaceTransform(src=self.working, dst=space)
        self._apply(transform, pixels, f"the color space {space!r}")

    def primaries(self, space: str) -> Shaped[F64, "3 3"]:
        """Primaries of a linear color space, from `canonical_space`, in linear Rec. 709, as columns."""
        rgb_axes = np.eye(3, dtype=np.float32)
        self.convert(rgb_axes, space)
        return np.asarray(np.linalg.inv(rgb_axes.T.astype(np.float64)))

    def table(self, view: OcioView) -> Shaped[NDArray[np.uint16], "N N N 3"]:
        """LUT of the view, see `relume.image_io.ocio.lut`. Raises ParameterError."""
        return self._table(view)

    def _build_table(self, view: OcioView) -> NDArray[np.uint16]:
        return build_lut(lambda pixels: self.apply_view(pixels, view))

    def _to_view(self, view: OcioView) -> Any:
        return self._ocio.DisplayViewTransform(src=self.working, display=view.display, view=view.view)

    def _processor(self, transform: Any) -> Any:
        return self._config.getProcessor(transform).getDefaultCPUProcessor()

    def _apply(self, transform: Any, pixels: F32, label: str) -> None:
        try:
            processor = self._processor(transform)  # cached by the config
        except _failures(self._ocio) as error:
            log.warning("%s does not work: %s", label, error)
            allowed = "another one, because this one needs a file that is missing or damaged; the server's log names it"
            raise ParameterError("color", label, allowed) from None
        for_ranges(lambda start, stop: processor.applyRGB(pixels[start:stop]), len(pixels), _ROWS_PER_RANGE)


def _module() -> Any:
    """Import OpenColorIO, which processes without a config never load."""
    import PyOpenColorIO

    PyOpenColorIO.SetLoggingLevel(PyOpenColorIO.LOGGING_LEVEL_WARNING)
    return PyOpenColorIO


def _failures(ocio: Any) -> tuple[type[Exception], ...]:
    return ocio.Exception, ocio.ExceptionMissingFile, UnicodeError  # messages about invalid text are invalid text too


def _error_text(error: Exception) -> str:
    return " ".join(str(error).split())[:400]


def _join_names(names: Any) -> str:
    return ", ".join(names)[:400]


def _read_config(ocio: Any, source: str) -> Any:
    allowed = "the path of a .ocio or .ocioz file, the name of a built-in config (ocio://studio-config-latest), or none"
    path = source if source.startswith("ocio://") else os.path.abspath(source)
    if path is not source and not os.path.isfile(path):
        raise ParameterError("RELUME_OCIO", source, f"{allowed} (there is no such file)")
    try:
        config = ocio.Config.CreateFromFile(path)
    except _failures(ocio) as error:
        raise ParameterError("RELUME_OCIO", source, f"{allowed} ({_error_text(error)})") from None
    try:
        config.validate()
    except _failures(ocio) as error:  # many configs that work well are not valid
        log.warning("the OpenColorIO config %s is not valid: %s", source, _error_text(error))
    return config


def _working_space(ocio: Any, config: Any, requested: str | None) -> str:
    """The config's name of linear Rec. 709. Raises ParameterError."""
    if requested is not None:
        space = config.getColorSpace(requested)
        if space is None or space.isData():
            raise ParameterError("RELUME_OCIO_SPACE", requested, "a color space of the config")
        return str(space.getName())
    for name in _NAMES:
        if (space := config.getColorSpace(name)) is not None:
            return str(space.getName())
    try:
        built_in = ocio.Config.CreateFromFile(_BUILT_IN)
        return str(ocio.Config.IdentifyBuiltinColorSpace(config, built_in, _BUILT_IN_SPACE))
    except _failures(ocio):
        names = _join_names(str(space.getName()) for space in config.getColorSpaces())
        allowed = f"the config's name of linear Rec. 709, which could not be identified among: {names}"
        raise ParameterError("RELUME_OCIO_SPACE", None, allowed) from None
