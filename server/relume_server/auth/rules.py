"""Required role of each call, checked before the body is read.

A call that is not listed is for admins only, and `tests/access` fails: every route needs a row here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from starlette.routing import compile_path

from relume_server.auth.roles import Caller, Role
from relume_server.errors import ForbiddenError

ANYONE, VIEW, EDIT, ADMIN = Role

SOCKET = "WEBSOCKET"
"""Method of opening a live session."""

RULES: Mapping[str, Mapping[str, Role]] = {
    "/livez": {"GET": ANYONE},
    "/readyz": {"GET": ANYONE},
    "/metrics": {"GET": VIEW},
    "/api/openapi.json": {"GET": ANYONE},
    "/api/me": {"GET": ANYONE},
    "/api/login": {"POST": ANYONE},
    "/api/logout": {"POST": ANYONE},
    "/api/audit": {"GET": ADMIN},
    "/api/scenes": {"GET": VIEW, "POST": EDIT},
    "/api/scenes/{scene}": {"GET": VIEW, "DELETE": EDIT},
    "/api/scenes/{scene}/ground": {"POST": EDIT},
    "/api/scenes/{scene}/thumbnail.webp": {"GET": VIEW},
    "/api/scenes/{scene}/clay.png": {"GET": VIEW},
    "/api/scenes/{scene}/exports": {"POST": EDIT},
    "/api/scenes/{scene}/exports/report": {"POST": EDIT},
    "/api/scenes/{scene}/cameras": {"GET": VIEW},
    "/api/scenes/{scene}/cameras/{name}": {"GET": VIEW, "PUT": EDIT, "DELETE": EDIT},
    "/api/scenes/{scene}/comments": {"GET": VIEW, "POST": EDIT},
    "/api/scenes/{scene}/comments/{comment}": {"PATCH": EDIT, "DELETE": EDIT},
    "/api/scenes/{scene}/comments/{comment}/picture.webp": {"GET": VIEW},
    "/api/scenes/{scene}/viewport": {"GET": VIEW, "POST": VIEW},
    "/api/scenes/{scene}/viewport/pick": {"POST": VIEW},
    "/api/scenes/{scene}/viewport/path": {"POST": VIEW},
    "/api/scenes/{scene}/ball": {"POST": VIEW},
    "/api/example-scenes": {"GET": VIEW},
    "/api/example-scenes/{name}": {"POST": EDIT},
    "/api/color": {"GET": VIEW},
    "/api/color/{config}/lut": {"GET": VIEW},
    "/api/models": {"GET": VIEW},
    "/api/models/principled": {"POST": VIEW},
    "/api/models/principled/terms": {"POST": VIEW},
    "/api/models/zernike-fit": {"POST": VIEW},
    "/api/models/albedo": {"POST": VIEW},
    "/api/materials": {"GET": VIEW},
    "/api/materials/map": {"GET": VIEW},
    "/api/materials/map/at": {"GET": VIEW},
    "/api/materials/{table}/{material}/thumbnail.png": {"GET": VIEW},
    "/api/materials/measured": {"GET": VIEW, "POST": EDIT},
    "/api/materials/measured/{material}": {"GET": VIEW, "DELETE": EDIT},
    "/api/materials/measured/{material}/thumbnail.png": {"GET": VIEW},
    "/api/materials/imported": {"GET": VIEW, "POST": EDIT},
    "/api/materials/imported/{material}": {"GET": VIEW, "DELETE": EDIT},
    "/api/materials/imported/{material}/{index}/thumbnail.png": {"GET": VIEW},
    "/api/materials/btf": {"GET": VIEW},
    "/api/materials/btf/{material}": {"GET": VIEW, "DELETE": EDIT},
    "/api/materials/btf/{material}/thumbnail.png": {"GET": VIEW},
    "/api/materials/btf/jobs": {"GET": VIEW, "POST": EDIT},
    "/api/materials/btf/jobs/synthetic": {"POST": EDIT},
    "/api/materials/btf/jobs/geometry": {"POST": EDIT},
    "/api/materials/btf/jobs/{job}": {"GET": VIEW, "DELETE": EDIT},
    "/api/materials/btf/jobs/{job}/resume": {"POST": EDIT},
    "/api/environments": {"GET": VIEW, "POST": EDIT},
    "/api/environments/{environment}": {"GET": VIEW, "DELETE": EDIT},
    "/api/environments/{environment}/thumbnail.png": {"GET": VIEW},
    "/api/luts": {"GET": VIEW, "POST": EDIT},
    "/api/luts/{lut}": {"GET": VIEW, "DELETE": EDIT},
    "/api/luts/{lut}/table": {"GET": VIEW},
    "/api/ies": {"GET": VIEW, "POST": EDIT},
    "/api/ies/{ies}": {"GET": VIEW, "DELETE": EDIT},
    "/api/images": {"GET": VIEW, "POST": EDIT},
    "/api/images/{image}": {"GET": VIEW, "DELETE": EDIT},
    "/api/images/{image}/metalness": {"POST": EDIT},
    "/api/images/{image}/thumbnail.png": {"GET": VIEW},
    "/api/bakes": {"GET": VIEW, "POST": EDIT},
    "/api/bakes/{bake}": {"GET": VIEW, "DELETE": EDIT},
    "/api/bakes/{bake}/events": {"GET": VIEW},
    "/api/bakes/{bake}/views/{view}/materials.png": {"GET": VIEW},
    "/api/bakes/{bake}/environment.png": {"GET": VIEW},
    "/api/bakes/{bake}/light-mix": {"POST": VIEW},
    "/api/bakes/{bake}/probes": {"GET": VIEW},
    "/api/bakes/{bake}/probes/{array}": {"GET": VIEW},
    "/api/bakes/{bake}/session": {SOCKET: VIEW},
    "/api/renders": {"GET": VIEW, "POST": EDIT},
    "/api/renders/looks": {"POST": VIEW},
    "/api/renders/{render}": {"GET": VIEW, "DELETE": EDIT},
    "/api/renders/{render}/resume": {"POST": EDIT},
    "/api/renders/{render}/frames/{index}": {"GET": VIEW},
    "/api/renders/{render}/frames/{index}/retry": {"POST": EDIT},
    "/api/renders/{render}/video.mp4": {"GET": VIEW},
    "/api/renders/{render}/archive.zip": {"GET": VIEW},
    "/api/renders/{render}/contact-sheet.png": {"GET": VIEW},
    "/api/comparisons": {"GET": VIEW, "POST": EDIT},
    "/api/comparisons/{comparison}": {"GET": VIEW, "DELETE": EDIT},
    "/api/comparisons/{comparison}/resume": {"POST": EDIT},
    "/api/comparisons/{comparison}/{name}.png": {"GET": VIEW},
    "/api/looks": {"GET": VIEW},
    "/api/looks/{name}": {"GET": VIEW, "PUT": EDIT, "DELETE": EDIT},
    "/api/shares": {"GET": VIEW, "POST": EDIT},
    "/api/looks/{name}/thumbnail": {"PUT": EDIT},
    "/api/looks/{name}/thumbnail.webp": {"GET": VIEW},
    "/api/looks/{name}/view": {"PUT": EDIT, "DELETE": EDIT},
    "/api/shares/{share}": {"GET": VIEW, "DELETE": EDIT},
    "/api/solve": {"POST": VIEW},
}

MESSAGES: Mapping[str, Role] = {
    "open": VIEW,
    "edit": EDIT,
    "edit_local": VIEW,  # edits of view settings only: exposure, light paths, solo
    "prepare": VIEW,  # editors also trigger precomputing; viewers get the values only
    "prepare_parameter": EDIT,  # a parameter: it only prepares edits
    "view": VIEW,
    "views": VIEW,
    "focus": VIEW,
    "region": VIEW,
    "camera": VIEW,
    "renderer": VIEW,
    "encoding": VIEW,
    "ack": VIEW,
    "inspect": VIEW,
    "path": VIEW,
    "highlight_curve_range": VIEW,
    "presence": VIEW,
    "ping": VIEW,
}
"""Required roles of session messages."""

_COMPILED: tuple[tuple[re.Pattern[str], Mapping[str, Role]], ...] = tuple(
    (compile_path(path)[0], roles) for path, roles in RULES.items()
)

_COMMENTS = compile_path("/api/scenes/{scene}/comments")[0]
_EXPORTS = tuple(compile_path(f"/api/scenes/{{scene}}/exports{end}")[0] for end in ("", "/report"))


def required_role(method: str, path: str) -> Role:
    """Required role of a call: the highest of all matching rows; none for files of the editor."""
    fitting = [roles[method] for pattern, roles in _COMPILED if method in roles and pattern.match(path)]
    if fitting:
        return max(fitting)
    is_file = method in ("GET", "HEAD") and not (path == "/api" or path.startswith("/api/"))
    return ANYONE if is_file else ADMIN


def methods_at(path: str) -> list[str]:
    """Methods of a path; routes know only their own method."""
    return sorted({method for pattern, roles in _COMPILED if pattern.match(path) for method in roles} - {SOCKET})


def is_comment(method: str, path: str) -> bool:
    """True if a call writes a comment, which settings may allow viewers."""
    return method == "POST" and _COMMENTS.match(path) is not None


def is_change(method: str, path: str) -> bool:
    """True if a call changes shared state: an unsafe method that needs more than the role view, other than exports."""
    if method in ("GET", "HEAD", "OPTIONS", SOCKET) or any(pattern.match(path) for pattern in _EXPORTS):
        return False
    return required_role(method, path) >= EDIT


def check_message(caller: Caller, kind: str) -> None:
    """Raise ForbiddenError if a caller may not send messages of this kind."""
    if caller.role < MESSAGES[kind] and caller.watches:
        raise ForbiddenError("this link is view-only; ask its sender for an edit link")
    if caller.role < MESSAGES[kind]:
        raise ForbiddenError(f"{caller.display_name} has view-only access; ask an admin for a token with the role edit")
