"""An OpenColorIO config: what of it pictures use, and its transforms of them.

A config is the operator's, as are the files that it names. Clients name displays, views and colour spaces; only names
that the config lists reach OpenColorIO, which fetches nothing from a network.
"""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Mapping
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.core.errors import ParameterError
from relume.core.thread_pools import for_ranges
from relume.image_io.ocio.lut import LAYOUT, build_lut
from relume.image_io.ocio.view import OcioView

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

log = logging.getLogger(__name__)

_NAMES = (  # of linear Rec. 709: the interop id, then what configs called it before there were any
    "lin_rec709_scene", "lin_rec709", "lin_rec709_srgb", "lin_srgb",
    "Linear Rec.709 (sRGB)", "Linear Rec.709", "Utility - Linear - Rec.709", "Utility - Linear - sRGB",
)  # fmt: skip
_BUILT_IN, _BUILT_IN_SPACE = "ocio://cg-config-latest", "lin_rec709_scene"
_NUM_CACHED_TABLES = 8  # 1.6 MB each
_ROWS_PER_RANGE = 1 << 14


class Config:
    """A config that has been read, and looked through.

    Attributes:
        name: as the config says, or its file's. id: of what is in it and how tables are made. 16 hexadecimal digits
        working: its name of linear Rec. 709. displays: their views, both in the config's order.
        default: the view that the config shows unasked.
    """

    def __init__(self, source: str, working: str | None = None) -> None:
        """
        Args:
            source: path of a .ocio or .ocioz file, or ocio://… of a built-in one.
            working: the config's name of linear Rec. 709; None: found by the names in use, then by what it does.
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
                "RELUME_OCIO", source, f"a config whose default view works: {_error_text(error)}"
            ) from None

    @cached_property
    def spaces(self) -> tuple[str, ...]:
        """Its linear colour spaces, which pictures are exported in."""
        spaces = [space for space in self._config.getColorSpaces() if not space.isData()]
        return tuple(str(space.getName()) for space in spaces if self._is_linear(space))

    def _is_linear(self, space: Any) -> bool:
        try:
            return bool(self._config.isColorSpaceLinear(space.getName(), self._ocio.REFERENCE_SPACE_SCENE))
        except _failures(self._ocio):  # a file that it needs is missing
            return False

    def check_view(self, view: OcioView) -> None:
        """Raise ParameterError unless it is one of the config's."""
        if view.display not in self.displays:
            raise ParameterError("display", view.display, f"one of {_join_names(self.displays)}")
        if view.view not in self.displays[view.display]:
            raise ParameterError("view", view.view, f"one of {_join_names(self.displays[view.display])}")

    def canonical_space(self, name: str) -> str:
        """The config's name of a linear colour space.

        Args:
            name: what it is called, an alias, or a role.
        Raises:
            ParameterError: the config has none that is called so.
        """
        canonical_name = str(self._config.getCanonicalName(name))
        if canonical_name not in self.spaces:
            raise ParameterError(
                "color_space", name, f"a linear colour space of the config: {_join_names(self.spaces)}"
            )
        return canonical_name

    def apply_view(self, pixels: F32, view: OcioView, *, use_table: bool = False) -> None:
        """Turn light into what a display is sent, in place.

        Args:
            pixels: linear Rec. 709, C-contiguous. (n, 3)
            use_table: by the view's table, in a third of the time, as the editor shows it.
        Raises:
            ParameterError: the config has no such view, or it does not work.
        """
        self.check_view(view)
        if use_table:
            from relume.image_io.ocio.sampling import apply_lut  # compiled

            return apply_lut(self.table(view), pixels)
        return self._apply(self._to_view(view), pixels, f"the view {view.view!r} of {view.display!r}")

    def convert(self, pixels: F32, space: str) -> None:
        """Convert light to another linear colour space, in place.

        Args:
            pixels: linear Rec. 709, C-contiguous. (n, 3)
            space: as `canonical_space` names it.
        Raises:
            ParameterError: the conversion does not work.
        """
        transform = self._ocio.ColorSpaceTransform(src=self.working, dst=space)
        self._apply(transform, pixels, f"the colour space {space!r}")

    def primaries(self, space: str) -> F64:
        """The primaries of a linear colour space, as `canonical_space` names it, in ours. (3, 3), columns"""
        rgb_axes = np.eye(3, dtype=np.float32)
        self.convert(rgb_axes, space)
        return np.asarray(np.linalg.inv(rgb_axes.T.astype(np.float64)))

    def table(self, view: OcioView) -> NDArray[np.uint16]:
        """The view as a table, see `relume.image_io.ocio.lut`. (N, N, N, 3) Raises ParameterError."""
        return self._table(view)

    def _build_table(self, view: OcioView) -> NDArray[np.uint16]:
        return build_lut(lambda pixels: self.apply_view(pixels, view))

    def _to_view(self, view: OcioView) -> Any:
        return self._ocio.DisplayViewTransform(src=self.working, display=view.display, view=view.view)

    def _processor(self, transform: Any) -> Any:
        return self._config.getProcessor(transform).getDefaultCPUProcessor()

    def _apply(self, transform: Any, pixels: F32, label: str) -> None:
        try:
            processor = self._processor(transform)  # the config keeps them
        except _failures(self._ocio) as error:
            log.warning("%s does not work: %s", label, error)
            allowed = "another: a file that it needs is missing or damaged, the server's log says which"
            raise ParameterError("color", label, allowed) from None
        for_ranges(lambda start, stop: processor.applyRGB(pixels[start:stop]), len(pixels), _ROWS_PER_RANGE)


def _module() -> Any:
    """OpenColorIO, which processes without a config never load."""
    import PyOpenColorIO

    PyOpenColorIO.SetLoggingLevel(PyOpenColorIO.LOGGING_LEVEL_WARNING)
    return PyOpenColorIO


def _failures(ocio: Any) -> tuple[type[Exception], ...]:
    return ocio.Exception, ocio.ExceptionMissingFile, UnicodeError  # its words about what is no text are none either


def _error_text(error: Exception) -> str:
    return " ".join(str(error).split())[:400]


def _join_names(names: Any) -> str:
    return ", ".join(names)[:400]


def _read_config(ocio: Any, source: str) -> Any:
    allowed = "the path of a .ocio or .ocioz file, the name of a built-in config (ocio://studio-config-latest), or none"
    path = source if source.startswith("ocio://") else os.path.abspath(source)
    if path is not source and not os.path.isfile(path):
        raise ParameterError("RELUME_OCIO", source, f"{allowed}; there is no such file")
    try:
        config = ocio.Config.CreateFromFile(path)
    except _failures(ocio) as error:
        raise ParameterError("RELUME_OCIO", source, f"{allowed}; {_error_text(error)}") from None
    try:
        config.validate()
    except _failures(ocio) as error:  # many that work well have faults
        log.warning("the OpenColorIO config %s is not valid: %s", source, _error_text(error))
    return config


def _working_space(ocio: Any, config: Any, requested: str | None) -> str:
    """The config's name of linear Rec. 709. Raises ParameterError."""
    if requested is not None:
        space = config.getColorSpace(requested)
        if space is None or space.isData():
            raise ParameterError("RELUME_OCIO_SPACE", requested, "a colour space of the config")
        return str(space.getName())
    for name in _NAMES:
        if (space := config.getColorSpace(name)) is not None:
            return str(space.getName())
    try:
        built_in = ocio.Config.CreateFromFile(_BUILT_IN)
        return str(ocio.Config.IdentifyBuiltinColorSpace(config, built_in, _BUILT_IN_SPACE))
    except _failures(ocio):
        names = _join_names(str(space.getName()) for space in config.getColorSpaces())
        allowed = f"the config's name of linear Rec. 709, which cannot be told from what it holds: {names}"
        raise ParameterError("RELUME_OCIO_SPACE", None, allowed) from None
