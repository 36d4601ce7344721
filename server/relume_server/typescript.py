"""Write the editor's types and look schema from the server's models.

`python -m relume_server.typescript [--check]`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import get_args

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from relume.brdf.term_validation import MAX_CURVE_VALUE, MAX_POINTS
from relume.core.validation import MAX_COLOR
from relume.export.principled_material import PRINCIPLED_RANGES
from relume.image_io.ocio.lut import GAIN, SIZE
from relume.live.fixed_camera.fidelity import Fidelity
from relume.look import LightLook, Look
from relume.look.document import DEFAULTS, MAX_TERMS, RANGES
from relume.look.glass import GLASS_RANGES
from relume.look.light_groups import MAX_LIGHT_GROUPS
from relume.look.light_validation import LIGHT_RANGES, RESERVED_LIGHT_NAMES, default_light
from relume.look.model import BasisFunctions
from relume.look.patch import MAX_OPERATIONS
from relume.scene.validate import MAX_LIGHT_NAME, MAX_LIGHTS
from relume_server.schemas import (
    bodies,
    btfs,
    cameras,
    color,
    comments,
    connection,
    exports,
    ies,
    images,
    login,
    looks,
    luts,
    message,
    models,
    probes,
    protocol,
    renders,
    rooms,
    solve,
)
from relume_server.ts_syntax import interface, literal, union

CLIENT = Path(__file__).resolve().parents[2] / "client_web" / "src"
HEAD = "// Written by `python -m relume_server.typescript` from the server's models. Do not edit.\n"

CLIENT_MESSAGES: tuple[type[BaseModel], ...] = (
    connection.OpenMessage,
    protocol.EditMessage,
    protocol.ViewMessage,
    protocol.ViewsMessage,
    protocol.FocusMessage,
    protocol.RegionMessage,
    protocol.AckMessage,
    protocol.EncodingMessage,
    protocol.InspectMessage,
    protocol.PathMessage,
    protocol.HighlightMessage,
    protocol.PrepareMessage,
    protocol.CameraMessage,
    protocol.RendererMessage,
    rooms.PresenceMessage,
    connection.PingMessage,
)
SERVER_MESSAGES: tuple[type[BaseModel], ...] = (
    protocol.HelloMessage,
    protocol.StatusMessage,
    protocol.ProblemMessage,
    protocol.InspectAnswer,
    protocol.PathAnswer,
    protocol.CurveMessage,
    protocol.BakeMessage,
    connection.DrainMessage,
    rooms.RoomMessage,
    rooms.RoomUpdate,
    rooms.CommentsMessage,
    connection.PongMessage,
)
INPUTS: tuple[type[BaseModel], ...] = (
    message.PatchOperation,
    *CLIENT_MESSAGES,
    bodies.BakeRequest,
    renders.LooksRequest,
    renders.RenderRequest,
    models.TermsRequest,
    models.ZernikeFitRequest,
    models.PrincipledRequest,
    models.PrincipledTermsRequest,
    bodies.ComparisonRequest,
    exports.ExportRequest,
    bodies.ShareRequest,
    comments.CommentRequest,
    comments.CommentChange,
    btfs.SyntheticBtfRequest,
    solve.SolveRequest,
)
OUTPUTS: tuple[type[BaseModel], ...] = (
    protocol.Problem,
    *SERVER_MESSAGES,
    protocol.FrameHeader,
    probes.FreeCameraBody,
    bodies.SceneBody,
    cameras.CameraEntry,
    cameras.ViewportBody,
    cameras.PickBody,
    cameras.PathBody,
    bodies.ExampleSceneBody,
    color.ColorBody,
    models.ModelBody,
    models.ZernikeFitBody,
    models.AlbedoBody,
    models.PrincipledBody,
    bodies.MaterialBody,
    bodies.MaterialMapBody,
    bodies.EnvironmentBody,
    ies.IesBody,
    images.ImageBody,
    images.MetalnessBody,
    luts.LutBody,
    bodies.MeasuredBody,
    bodies.ImportedBody,
    bodies.BtfBody,
    btfs.BtfJobBody,
    bodies.PlanBody,
    bodies.BakeBody,
    bodies.DryRunBody,
    renders.LooksBody,
    looks.MixedLookBody,
    renders.RenderBody,
    bodies.RenderPlanBody,
    bodies.ComparisonBody,
    bodies.ComparisonPlanBody,
    exports.ExportReportBody,
    login.MeBody,
    bodies.LookEntry,
    bodies.ShareEntry,
    bodies.ShareBody,
    comments.CommentBody,
    solve.SolveBody,
)


def generate_protocol() -> str:
    """Messages and bodies; deterministic."""
    blocks = [HEAD]
    limits = "MAX_MESSAGE_BYTES", "MAX_FRAMES_IN_FLIGHT", "MAX_VISIBLE_VIEWS", "MAX_CAMERA_PIXELS"
    for name in ("SUBPROTOCOL", *limits, "PROBES_LAYOUT"):
        value = getattr(protocol, name)
        blocks.append(f"export const {name} = {literal(value)};")
    blocks.append(f"export const MAX_PERSON_NAME = {rooms.MAX_PERSON_NAME};")
    blocks.append(f"export const ROOM_PREFIX = {rooms.ROOM_PREFIX};")
    blocks.append(f"export const MAX_COMMENT = {comments.MAX_COMMENT};")
    blocks.append(f"export const LUT_SIZE = {literal(SIZE)};")
    blocks.append(f"export const LUT_GAIN = {literal(GAIN)};")
    blocks.append(f"/** Worst first. */\nexport const FIDELITIES: Fidelity[] = {literal(list(Fidelity))};")
    definitions = dict[str, str]()
    for mode, mode_models in (("validation", INPUTS), ("serialization", OUTPUTS)):
        _, schema = models_json_schema([(m, mode) for m in mode_models], by_alias=True)  # type: ignore[misc]
        for name, body in sorted(schema["$defs"].items()):
            # a definition that inputs and outputs share is written once, with the optional fields of inputs
            definitions.setdefault(name, interface(name, body, mode))
    blocks.extend(definitions.values())
    blocks.append(union("ClientMessage", CLIENT_MESSAGES))
    blocks.append(union("ServerMessage", SERVER_MESSAGES))
    return "\n\n".join(blocks) + "\n"


def generate_look() -> str:
    """The look document: types, default values, and ranges of numbers."""
    _, schema = models_json_schema([(Look, "validation")])
    lights: tuple[type[BaseModel], ...] = get_args(get_args(LightLook)[0])
    blocks = [HEAD, *(interface(name, body, "validation") for name, body in sorted(schema["$defs"].items()))]
    blocks.append(union("LightLook", lights))
    blocks.append('type LightsByKind = { readonly [K in LightLook["kind"]]: Extract<LightLook, { kind: K }> };')
    kinds = [str(get_args(light.model_fields["kind"].annotation)[0]) for light in lights]
    defaults = "".join(f"  {kind}: {literal(default_light(kind))},\n" for kind in kinds)
    blocks.append(
        f"/** A light of each kind, complete. */\nexport const DEFAULT_LIGHTS: LightsByKind = {{\n{defaults}}};"
    )
    sections = "".join(f"  {name}: {literal(fields)},\n" for name, fields in DEFAULTS.items())
    names = " | ".join(literal(name) for name in DEFAULTS)
    blocks.append(f"export const DEFAULTS: Readonly<Pick<Look, {names}>> = {{\n{sections}}};")
    ranges = "".join(f"  {name}: {_ranges(fields)},\n" for name, fields in {**RANGES, **_EXTRA_RANGES}.items())
    blocks.append(f"/** Ranges of the numbers of each field. */\nexport const RANGES = {{\n{ranges}}} as const;")
    blocks.append("\n".join(f"export const {name} = {literal(value)};" for name, value in _CONSTANTS.items()))
    return "\n\n".join(blocks) + "\n"


_EXTRA_RANGES = {
    "light": LIGHT_RANGES,
    "glass": GLASS_RANGES,
    "principled": PRINCIPLED_RANGES,
    "term": {"color": (0.0, MAX_COLOR)},
}
_CONSTANTS = {
    "MAX_TERMS": MAX_TERMS,
    "BASIS_FUNCTIONS": get_args(BasisFunctions),
    "MAX_LIGHTS": MAX_LIGHTS,
    "MAX_LIGHT_GROUPS": MAX_LIGHT_GROUPS,
    "MAX_LIGHT_NAME": MAX_LIGHT_NAME,
    "RESERVED_LIGHT_NAMES": RESERVED_LIGHT_NAMES,
    "MAX_CURVE_POINTS": MAX_POINTS,
    "MAX_CURVE_VALUE": MAX_CURVE_VALUE,
    "MAX_OPERATIONS": MAX_OPERATIONS,
}


def _ranges(fields: Mapping[str, tuple[float, float]]) -> str:
    return literal({name: {"minimum": minimum, "maximum": maximum} for name, (minimum, maximum) in fields.items()})


def main() -> int:
    """Write the files, or with --check report stale ones."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; fail if a file is stale")
    is_check = parser.parse_args().check
    stale = [path for path, generate in TARGETS.items() if _text(path) != generate()]
    for path in stale:
        if is_check:
            sys.stderr.write(f"{path.name} is stale; run python -m relume_server.typescript\n")
        else:
            path.write_text(TARGETS[path](), encoding="utf-8")
    return int(is_check and bool(stale))


def _text(path: Path) -> str | None:
    return path.read_text(encoding="utf-8") if path.exists() else None


TARGETS = {CLIENT / "protocol.gen.ts": generate_protocol, CLIENT / "look.gen.ts": generate_look}

if __name__ == "__main__":
    sys.exit(main())
