"""The body of /api/color: what of the server's OpenColorIO config looks and renders may name."""

from __future__ import annotations

from relume_server.schemas.base import Body


class DisplayBody(Body):
    """A display and its views, in the config's order."""

    name: str
    views: list[str]


class ViewBody(Body):
    """A view of a display, as looks name it in `display.tone_map`."""

    display: str
    view: str


class ColorBody(Body):
    """Without a config all of it is null or empty. `id` changes with the config; `default`: the view that the config
    shows unasked; `working`: its name of linear Rec. 709; `spaces`: its linear colour spaces, in which EXR files may be
    rendered."""

    id: str | None
    name: str | None
    working: str | None
    displays: list[DisplayBody]
    default: ViewBody | None
    spaces: list[str]
