"""Complete looks: the scene's default, and partial looks merged into it, checked as they are merged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, get_args

from relume import environments
from relume.brdf.channels import check_image, check_shared
from relume.brdf.document import complete_term
from relume.checks import MAX_COLOR, Pointer, check_number, check_object, check_triple, fail, names_text
from relume.errors import ParameterError
from relume.imageio.ocio.view import MAX_NAME
from relume.look.lights import MAX_SCALE, complete_lights, default_lights
from relume.look.model import Backdrop, Look, Show, ToneMap
from relume.scene.model import Light, Material

MAX_TERMS = 16
MAX_BOUNCES = 24  # between white walls, which reflect 0.73, a thousandth of the light is left after 22
NORMAL_SCALE = (0.0, 10.0)
RANGES: dict[str, dict[str, tuple[float, float]]] = {  # of each number of a field; degrees, stops
    "environment": {"scale": (0.0, MAX_SCALE), "color": (0.0, MAX_COLOR), "rotation": (-360.0, 360.0)},
    "background": {"color": (0.0, MAX_COLOR), "blur": (2.0, 60.0)},
    "transport": {"bounces": (0, MAX_BOUNCES)},
    "display": {"exposure": (-20.0, 20.0)},
}
DEFAULTS: dict[str, dict[str, Any]] = {
    "environment": {"map": None, "scale": 1.0, "color": [1.0, 1.0, 1.0], "rotation": 0.0},
    "background": {"kind": "map", "color": [0.5, 0.5, 0.5], "blur": 10.0},
    "transport": {"show": "all", "bounces": MAX_BOUNCES},
    "display": {"exposure": 0.0, "tone_map": "agx"},
}
_SECTIONS = tuple(Look.model_fields)


def default_look(scene_materials: Sequence[Material], scene_lights: Sequence[Light] = ()) -> dict[str, Any]:
    """The complete look of a scene that nobody has edited.

    Raises:
        ParameterError: a material's own terms, or a light's fields, are not valid.
    """
    return {
        "materials": {
            material.name: {
                "terms": _complete_terms(("materials", material.name, "terms"), list(material.terms), ()),
                **({"catcher": True} if material.catcher else {}),
            }
            for material in scene_materials
        },
        "environment": dict(DEFAULTS["environment"]),
        "background": dict(DEFAULTS["background"]),
        "lights": default_lights(scene_lights, [material.name for material in scene_materials]),
        "transport": dict(DEFAULTS["transport"]),
        "display": dict(DEFAULTS["display"]),
    }


def complete(partial: Mapping[str, Any], default: Mapping[str, Any]) -> dict[str, Any]:
    """A complete, valid document: what `partial` does not name is as in `default`.

    A material's list of terms is taken whole; a term's missing fields have its model's defaults.

    Raises:
        ParameterError: with the JSON pointer of the first thing that is wrong, and what is allowed there.
    """
    return complete_changes(partial, default, default)


def validate(document: Mapping[str, Any], default: Mapping[str, Any]) -> Look:
    """The complete look of a document, which may be partial. Raises ParameterError as `complete` does."""
    return Look.model_validate(complete(document, default))


def complete_changes(partial: Any, default: Mapping[str, Any], known: Mapping[str, Any]) -> dict[str, Any]:
    """`complete`, checking only what an edit changed, which is little.

    Args:
        partial: the look after an edit; anything.
        default: the complete look of the scene that nobody has edited.
        known: a valid document; what is part of it, as an object, is not checked again.
    Returns:
        A document that shares with `known` all that did not change.
    Raises:
        ParameterError: as `complete` does.
    """
    check_object((), partial, _SECTIONS)
    return {
        "materials": _complete_materials(partial.get("materials", {}), default["materials"], known["materials"]),
        "environment": _complete_environment(
            partial.get("environment", {}), default["environment"], known["environment"]
        ),
        "background": _complete_background(partial.get("background", {}), default.get("background", {})),
        "lights": complete_lights(partial.get("lights", {}), default["lights"], known["lights"]),
        "transport": _complete_transport(partial.get("transport", {}), default.get("transport", {})),
        "display": _complete_display(partial.get("display", {}), default["display"]),
    }


def _complete_materials(given: Any, default: Mapping[str, Any], known: Mapping[str, Any]) -> dict[str, Any]:
    _check_names(("materials",), given, default, "material")
    return {name: _complete_material(name, given.get(name, default[name]), default, known) for name in default}


def _complete_material(name: str, given: Any, default: Mapping[str, Any], known: Mapping[str, Any]) -> Any:
    if given is known[name] or given is default[name]:
        return given
    pointer: Pointer = ("materials", name)
    merged = _merged(pointer, given, {**default[name], "normal_map": None})  # only a scene's ground may be a catcher
    if not isinstance(merged.get("catcher", True), bool):
        raise fail((*pointer, "catcher"), merged["catcher"], "true or false")
    normals = _complete_normals((*pointer, "normal_map"), merged.pop("normal_map", None))
    return {**merged, "terms": _complete_terms((*pointer, "terms"), merged["terms"], known[name]["terms"]), **normals}


def _complete_normals(pointer: Pointer, given: Any) -> dict[str, Any]:
    """The image in the place of a material's normal map, with its scale; left out where there is none."""
    if given is None:
        return {}
    merged = _merged(pointer, given, {"image": None, "scale": 1.0})
    check_number((*pointer, "scale"), merged["scale"], *NORMAL_SCALE)
    return {"normal_map": {**merged, "image": check_image((*pointer, "image"), merged["image"])}}


def _complete_terms(pointer: Pointer, given: Any, known: Sequence[Any]) -> list[Any]:
    if not isinstance(given, list | tuple) or len(given) > MAX_TERMS:
        raise fail(pointer, given, f"a list of at most {MAX_TERMS} terms")
    before = [*known, *[None] * (len(given) - len(known))]
    terms = [
        term if term is was and was is not None else complete_term((*pointer, k), term, was)
        for k, (term, was) in enumerate(zip(given, before, strict=False))
    ]
    check_shared(pointer, terms)
    return terms


def _complete_environment(given: Any, default: Mapping[str, Any], known: Mapping[str, Any]) -> dict[str, Any]:
    merged = _merged(("environment",), given, {**DEFAULTS["environment"], **default})  # older stores name no map
    if merged["map"] != known.get("map"):
        _check_map(("environment", "map"), merged["map"])
    ranges = RANGES["environment"]
    check_number(("environment", "scale"), merged["scale"], *ranges["scale"])
    check_triple(("environment", "color"), merged["color"], *ranges["color"])
    check_number(("environment", "rotation"), merged["rotation"], *ranges["rotation"])
    return merged


def _check_map(pointer: Pointer, name: Any) -> None:
    if name is not None and not (isinstance(name, str) and environments.is_known(name)):
        known = names_text(environments.known_names())
        raise fail(pointer, name, f"null for the scene's own, or an environment that is here: {known}")


def _complete_background(given: Any, default: Mapping[str, Any]) -> dict[str, Any]:
    pointer = ("background",)
    merged = _merged(pointer, given, {**DEFAULTS["background"], **default})  # older stores know of no background
    if merged["kind"] not in get_args(Backdrop):
        raise fail((*pointer, "kind"), merged["kind"], f"one of {names_text(get_args(Backdrop))}")
    check_triple((*pointer, "color"), merged["color"], *RANGES["background"]["color"])
    check_number((*pointer, "blur"), merged["blur"], *RANGES["background"]["blur"])
    return merged


def _complete_transport(given: Any, default: Mapping[str, Any]) -> dict[str, Any]:
    pointer = ("transport",)
    merged = _merged(pointer, given, {**DEFAULTS["transport"], **default})  # older stores know of no transport
    if merged["show"] not in get_args(Show):
        raise fail((*pointer, "show"), merged["show"], f"one of {names_text(get_args(Show))}")
    bounces = merged["bounces"]
    if not isinstance(bounces, int) or isinstance(bounces, bool) or not 0 <= bounces <= MAX_BOUNCES:
        raise fail((*pointer, "bounces"), bounces, f"a whole number from 0 to {MAX_BOUNCES}")
    return merged


def _complete_display(given: Any, default: Mapping[str, Any]) -> dict[str, Any]:
    merged = _merged(("display",), given, default)
    check_number(("display", "exposure"), merged["exposure"], *RANGES["display"]["exposure"])
    _check_tone_map(("display", "tone_map"), merged["tone_map"])
    return merged


def _check_tone_map(pointer: Pointer, given: Any) -> None:
    """Whether the server has such a view is told where it is shown: looks travel between servers."""
    is_name = isinstance(given, str) and given in get_args(ToneMap)
    is_view = isinstance(given, Mapping) and given.keys() == {"display", "view"}
    if is_view:
        is_view = all(isinstance(name, str) and _is_told(name) for name in given.values())
    if not (is_name or is_view):
        views = "or a view of an OpenColorIO config, {display, view}"
        raise fail(pointer, given, f"one of {names_text(get_args(ToneMap))}, {views}")


def _is_told(name: str) -> bool:
    return 0 < len(name) <= MAX_NAME and name.isprintable()  # half of a surrogate pair is no text that can be sent


def _merged(pointer: Pointer, given: Any, default: Mapping[str, Any]) -> dict[str, Any]:
    check_object(pointer, given, default)
    return {**default, **given}


def _check_names(pointer: Pointer, given: Any, default: Mapping[str, Any], what: str) -> None:
    if not isinstance(given, Mapping):
        raise fail(pointer, given, f"an object with a field for each {what} to change")
    unknown = given.keys() - default.keys()
    if unknown:
        name = min(unknown, key=str)
        raise ParameterError("/".join(["", *map(str, pointer)]), name, f"a {what} of this scene: {names_text(default)}")
