"""A live image in a notebook: sliders for numbers of the look, orbit of a free camera.

Frames come through the kernel, so that the browser need not reach the server. Messages: `frame`, with an encoded image
and its status, and `status` to `widget.js`; from it `ready` and `shown`, which ask for frames, `edit`, and `orbit`.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import anywidget
import numpy as np
import traitlets
from numpy.typing import NDArray

from relume_client.bodies import ModelBody, ViewInfo
from relume_client.cameras import Orbit
from relume_client.client import Bake
from relume_client.images import Frame
from relume_client.looks import Look, LookPart

Slider = str | tuple[str, float, float]
_MAX_UNSHOWN_S = 0.5
"""A busy kernel does not read that a frame was shown: then the next one is sent anyway."""
_TURN_PIXELS = 800.0
_RANGES: Mapping[str, tuple[float, float]] = {
    "rotation": (0, 360),
    "intensity": (0, 5),
    "exposure": (-5, 5),
    "blur": (0, 1),
}
"""Ranges of numbers that are no parameters of a term."""


@dataclass(frozen=True)
class Control:
    """A slider; `scale` is linear or log."""

    label: str
    minimum: float
    maximum: float
    value: float
    scale: str = "linear"


class LookWidget(anywidget.AnyWidget):
    """Live image of a bake, with sliders for numbers of its look.

        widget = LookWidget(bake, ["Bowl.roughness", "environment.rotation", ("Key light.intensity", 0, 50)])

    With a free camera, dragging in the image or the arrow keys orbit, and the wheel, + and − zoom.

    Args:
        bake: a finished bake.
        sliders: names of numbers in the look, each perhaps with minimum and maximum.
        view: name of a view; by default the first.
    Raises:
        ValueError: the look has no such number; the message lists what there is.
    """

    _esm = Path(__file__).with_name("widget.js")
    controls: traitlets.List[Any] = traitlets.List().tag(sync=True)
    title = traitlets.Unicode().tag(sync=True)
    can_orbit = traitlets.Bool(False).tag(sync=True)

    def __init__(self, bake: Bake, sliders: Sequence[Slider] = (), *, view: str | None = None) -> None:
        session = bake.session(view=view)
        session.__enter__()
        try:
            numbers = [_find(session.look, slider) for slider in sliders]
            models = bake.models() if sliders else []
            controls = [_control(*each, models, slider) for each, slider in zip(numbers, sliders, strict=True)]
        except BaseException:
            session.close()
            raise
        info = session.view
        super().__init__(
            controls=[asdict(control) for control in controls],
            title=f"View {info['name']}",
            can_orbit=info["camera_mode"] == "free",
        )
        self._session, self._numbers, self._orbit = session, numbers, _first_orbit(info)
        self._frame: Frame | None = None
        self._sent_s: float | None = None
        self.on_msg(self._on_page_message)
        session.subscribe(self._on_frame)
        session.set_encoding("jpeg")

    @property
    def look(self) -> Look:
        """The complete look. Its edits change the image, but no slider."""
        return self._session.look

    @property
    def image(self) -> NDArray[np.uint8]:
        """Exact image of the look, as displayed. (height, width, 3) uint8"""
        try:
            return self._session.frame(exact=True)
        finally:
            self._session.set_encoding("jpeg")

    def close(self) -> None:
        """Leave the session, and remove the widget."""
        if "_session" in self.__dict__:  # a widget that could not be made is closed as it is deleted
            self._session.close()
        super().close()

    def _on_frame(self, frame: Frame | None) -> None:
        """Send the frame to the page, or when the page has shown the one before; in the client's thread."""
        if frame is None:
            self.send({"type": "status", "status": "Connecting"})
            return
        self._frame = frame
        if self._sent_s is None or time.monotonic() - self._sent_s > _MAX_UNSHOWN_S:
            self._send_frame()

    def _send_frame(self) -> None:
        frame, self._frame = self._frame, None
        self._sent_s = None if frame is None else time.monotonic()
        if frame is not None:
            status = "Exact" if frame.header["exact"] else "Refining"
            content = {"type": "frame", "format": frame.header["format"], "status": status}
            self.send(content, buffers=[frame.payload])

    def _on_page_message(self, _: object, message: Mapping[str, Any], __: object) -> None:
        match message["type"]:
            case "ready":
                self._session.refresh()
            case "shown":
                self._send_frame()
            case "edit":
                owner, name = self._numbers[message["control"]]
                owner[name] = message["value"]
            case "orbit" if self.can_orbit:
                turn = 2 * np.pi / _TURN_PIXELS
                self._orbit = self._orbit.turned(-turn * message["x"], turn * message["y"], message["zoom"])
                self._session.move_camera(self._orbit.pose())


def _first_orbit(view: ViewInfo) -> Orbit:
    pose = np.reshape(view["camera"]["to_world"], (4, 4))
    bounds = view["bounds"]
    middle = pose[:3, 3] - pose[:3, 2] if bounds is None else np.mean(bounds, axis=0)
    return Orbit.from_pose(pose, middle)


def _find(look: Look, slider: Slider) -> tuple[LookPart, str]:
    """The part of the look that has a number, and its name. Names of materials may have dots: the longest counts."""
    text = slider if isinstance(slider, str) else slider[0]
    owner: Any = look
    steps = text.split(".")
    while True:
        count = next((n for n in range(len(steps), 0, -1) if ".".join(steps[:n]) in owner), 1)
        name, steps = ".".join(steps[:count]), steps[count:]
        try:
            value = owner[int(name) if name.isdigit() and name not in owner else name]
        except (KeyError, IndexError) as error:
            raise ValueError(f"there is no slider for {text!r}: {error.args[0]}") from None
        if not steps and isinstance(value, int | float) and not isinstance(value, bool):
            return owner, name
        if not steps or not isinstance(value, LookPart):
            raise ValueError(f"there is no slider for {text!r}, which is {value!r}; name a number")
        owner = value


def _control(owner: LookPart, name: str, models: Sequence[ModelBody], slider: Slider) -> Control:
    """The slider of a number: with the range that was given, that of a parameter, or one that suits its value."""
    label, value = slider if isinstance(slider, str) else slider[0], float(owner[name])
    path = owner._find(name)
    if not isinstance(slider, str):
        return Control(label, slider[1], slider[2], value)
    if path[-2] == "params":
        model = owner._root.materials[path[1]].terms[path[3]].model
        parameter = next(p for m in models if m["model"] == model for p in m["parameters"] if p["name"] == name)
        scale = parameter["scale"] if parameter["minimum"] > 0 else "linear"
        return Control(label, parameter["minimum"], parameter["maximum"], value, scale)
    low, high = _RANGES.get(name, (0.0, 1.0))
    return Control(label, min(low, value), max(high, 4 * value), value)
