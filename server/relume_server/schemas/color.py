"""Body of /api/color: displays, views and color spaces of the server's OpenColorIO config."""

from __future__ import annotations

from relume_server.schemas.base import Body


class DisplayBody(Body):
    """A display and its views, in the config's order."""

    name: str
    views: list[str]


class ViewBody(Body):
    """A view of a display, as in a look's `display.tone_map`."""

    display: str
    view: str


class ColorBody(Body):
    """OpenColorIO config of the server; all fields are null or empty without one. `id` changes with the config;
    `default`: its default view; `working`: its name of linear Rec. 709; `spaces`: its linear color spaces, for EXR
    files.
    """

    id: str | None
    name: str | None
    working: str | None
    displays: list[DisplayBody]
    default: ViewBody | None
    spaces: list[str]
