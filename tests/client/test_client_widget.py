"""The notebook widget, without a page: messages of the page, and what it is sent."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from server_fakes import SIZE

from relume.image_io.tone_mapping import tone_map
from relume.image_io.write_image import to_bytes
from relume_client import Bake, look_at

if TYPE_CHECKING:
    from relume_client.widget import LookWidget

pytest.importorskip("anywidget", reason="the widget needs anywidget: pip install relume[notebook]")


def displayed(radiance: float) -> np.ndarray:
    return to_bytes(tone_map(np.full((SIZE[1], SIZE[0], 3), radiance, np.float32), 0.0, "agx"))


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[tuple[dict[str, Any], list[bytes]]]:
    """Messages to the page, with their buffers."""
    from relume_client.widget import LookWidget

    messages = list[tuple[dict[str, Any], list[bytes]]]()
    monkeypatch.setattr(LookWidget, "send", lambda _, content, buffers=(): messages.append((content, list(buffers))))
    return messages


@pytest.fixture
def widget(bake: Bake, sent: object) -> Iterator[LookWidget]:
    from relume_client.widget import LookWidget

    widget = LookWidget(bake, ["Paper.sigma", "environment.intensity", ("Paper.terms.1.params.ior", 1.2, 2.0)])
    yield widget
    widget.close()


def test_sliders_have_the_ranges_of_parameters(widget: LookWidget) -> None:
    assert widget.controls == [
        {"label": "Paper.sigma", "minimum": 0.005, "maximum": 2.0, "value": 0.2, "scale": "log"},
        {"label": "environment.intensity", "minimum": 0.0, "maximum": 5.0, "value": 1.0, "scale": "linear"},
        {"label": "Paper.terms.1.params.ior", "minimum": 1.2, "maximum": 2.0, "value": 1.5, "scale": "linear"},
    ]
    assert (widget.title, widget.can_orbit) == ("View front", False)


def test_slider_edits_the_look_and_the_image(widget: LookWidget) -> None:
    widget._on_page_message(widget, {"type": "edit", "control": 0, "value": 0.4}, [])
    assert widget.look["Paper"].sigma == 0.4
    assert np.array_equal(widget.image, displayed(0.9))


def test_page_gets_a_frame_when_it_has_shown_the_one_before(
    widget: LookWidget, sent: list[tuple[dict[str, Any], list[bytes]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("relume_client.widget._MAX_UNSHOWN_S", 1e9)
    deadline = time.monotonic() + 30
    while not sent and time.monotonic() < deadline:
        time.sleep(0.01)
    widget._on_page_message(widget, {"type": "edit", "control": 0, "value": 0.4}, [])
    assert np.array_equal(widget.image, displayed(0.9))
    assert len(sent) == 1
    widget._on_page_message(widget, {"type": "shown"}, [])
    (content, buffers) = sent[1]
    assert (content["type"], content["status"]) == ("frame", "Exact")
    assert buffers[0][:4] in (b"\x89PNG", b"\xff\xd8\xff\xe0")


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("Paper.sigmo", "did you mean 'sigma'"),
        ("Paper", "name a number"),
        ("Paper.terms.7.color", "range"),
        ("Paper.color", "several terms"),
        ("Paper.lambert.color", "name a number"),
        ("nothing.at.all", "the look has no 'nothing'"),
    ],
)
def test_sliders_need_a_number(bake: Bake, name: str, reason: str) -> None:
    from relume_client.widget import LookWidget

    with pytest.raises(ValueError, match=reason):
        LookWidget(bake, [name])


def test_drag_orbits_about_the_middle_of_the_scene(widget: LookWidget, monkeypatch: pytest.MonkeyPatch) -> None:
    from relume_client.widget import _first_orbit

    poses = list[np.ndarray]()
    monkeypatch.setattr(widget._session, "move_camera", poses.append)
    camera = {"to_world": look_at([0, 0, 4], [0, 0, 0]).ravel().tolist(), "yfov": 1.0, "near": 0.0}
    info: Any = {"camera": camera, "bounds": ([-1, -1, -1], [1, 1, 1])}
    widget.can_orbit, widget._orbit = True, _first_orbit(info)
    widget._on_page_message(widget, {"type": "orbit", "x": -200, "y": 0, "zoom": 0.5}, [])
    assert np.allclose(poses[0], look_at([2, 0, 0], [0, 0, 0]))
