"""Complete looks: the scene's default look, and partial looks that are validated and merged into it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, get_args

from relume.assets.environments.environment_names import environment_exists, environment_names
from relume.brdf.term_validation import complete_term
from relume.brdf.texture_slots import check_image, check_shared
from relume.core.errors import ParameterError
from relume.core.validation import (
    MAX_COLOR,
    Pointer,
    check_number,
    check_object,
    check_triple,
    invalid_value,
    names_text,
)
from relume.image_io.contrast import CONTRASTS, NEUTRAL_CONTRAST
from relume.image_io.ocio.view import MAX_NAME
from relume.image_io.white_balance import NEUTRAL_TEMPERATURE, TEMPERATURES, TINTS
from relume.look.glass import complete_glass, default_glass
from relume.look.light_groups import complete_light_groups, default_light_groups
from relume.look.light_mix import expand_light_mix
from relume.look.light_validation import MAX_INTENSITY, complete_lights, default_lights, emissive_materials
from relume.look.link_validation import check_link
from relume.look.model import BackgroundKind, BasisFunctions, Look, PathFilter, ToneMap
from relume.look.object_materials import check_not_emissive, default_materials
from relume.look.uv_transforms import complete_uv
from relume.luts.lut_store import LUTS
from relume.scene.model import Light, Material

MAX_TERMS = 16
MAX_BOUNCES = 24  # white walls reflect at most 0.73: a thousandth of the light remains after 22 bounces
NORMAL_SCALE = (0.0, 10.0)
RANGES: dict[str, dict[str, tuple[float, float]]] = {  # of each number in a field; degrees, stops
    "environment": {"intensity": (0.0, MAX_INTENSITY), "color": (0.0, MAX_COLOR), "rotation": (-360.0, 360.0)},
    "background": {"color": (0.0, MAX_COLOR), "blur": (2.0, 60.0)},
    "transport": {"bounces": (0, MAX_BOUNCES)},
    "display": {"exposure": (-20.0, 20.0), "temperature": TEMPERATURES, "tint": TINTS, "contrast": CONTRASTS},
}
DEFAULTS: dict[str, dict[str, Any]] = {
    "environment": {"map": None, "intensity": 1.0, "color": [1.0, 1.0, 1.0], "rotation": 0.0, "link": None},
    "background": {"kind": "map", "color": [0.5, 0.5, 0.5], "blur": 10.0},
    "transport": {"show": "all", "bounces": MAX_BOUNCES},
    "display": {
        "exposure": 0.0,
        "tone_map": "agx",
        "temperature": NEUTRAL_TEMPERATURE,
        "tint": 0.0,
        "contrast": NEUTRAL_CONTRAST,
        "lut": None,
    },
}
_OPTIONAL = {"normal_map": None, "uv": None, "glass": None, "basis_functions": None}  # of materials
_SECTIONS = tuple(Look.model_fields)


def default_look(scene_materials: Sequence[Material], scene_lights: Sequence[Light] = ()) -> dict[str, Any]:
    """Return the complete, unedited look of a scene.

    Raises:
        ParameterError: a material's terms or a light's fields are invalid.
    """
    return {
        "materials": {
            material.name: {
                "terms": _complete_terms(("materials", material.name, "terms"), list(material.terms), ()),
                **({"shadow_catcher": True} if material.shadow_catcher else {}),
                **({} if material.glass is None else {"glass": default_glass(material.glass)}),
            }
            for material in scene_materials
        },
        "environment": dict(DEFAULTS["environment"]),
        "background": dict(DEFAULTS["background"]),
        "lights": default_lights(scene_lights, [material.name for material in scene_materials]),
        "light_groups": default_light_groups(scene_lights),
        "transport": dict(DEFAULTS["transport"]),
        "display": dict(DEFAULTS["display"]),
    }


def complete(partial: Mapping[str, Any], default: Mapping[str, Any]) -> dict[str, Any]:
    """Complete a partial look: fields that `partial` omits are taken from `default`.

    A material's list of terms is replaced as a whole. Missing fields of a term get its model's defaults. `partial` may
    be a light mix (`relume.look.light_mix`).

    Raises:
        ParameterError: with the JSON pointer of the first invalid value, and the allowed values.
    """
    return complete_changes(expand_light_mix(partial, default)[0], default, default)


def validate(document: Mapping[str, Any], default: Mapping[str, Any]) -> Look:
    """Return the complete look of a possibly partial document. Raises ParameterError as `complete` does."""
    return Look.model_validate(complete(document, default))


def complete_changes(partial: Any, default: Mapping[str, Any], previous: Mapping[str, Any]) -> dict[str, Any]:
    """Do the same as `complete`, but validate only the changes of an edit.

    Args:
        partial: the look after an edit, not yet validated.
        default: the complete, unedited look of the scene.
        previous: a valid document; objects that `partial` shares with it are not validated again.
    Returns:
        A document that shares all unchanged objects with `previous`.
    Raises:
        ParameterError: as `complete` does.
    """
    check_object((), partial, _SECTIONS)
    lights = complete_lights(partial.get("lights", {}), default["lights"], previous["lights"], default["materials"])
    materials = _complete_materials(partial.get("materials", {}), default["materials"], previous["materials"])
    check_not_emissive(materials, (name for light in lights.values() for name in emissive_materials(light)))
    default_groups = default.get("light_groups", {})  # older stores have no groups
    return {
        "materials": materials,
        "environment": _complete_environment(
            partial.get("environment", {}), default["environment"], previous["environment"], default["materials"]
        ),
        "background": _complete_background(partial.get("background", {}), default.get("background", {})),
        "lights": lights,
        "light_groups": complete_light_groups(
            partial.get("light_groups", default_groups), default_groups, previous.get("light_groups", {}), lights
        ),
        "transport": _complete_transport(partial.get("transport", {}), default.get("transport", {})),
        "display": _complete_display(partial.get("display", {}), default["display"], previous.get("display", {})),
    }


def _complete_materials(partial: Any, default: Mapping[str, Any], previous: Mapping[str, Any]) -> dict[str, Any]:
    if not isinstance(partial, Mapping):
        raise invalid_value(("materials",), partial, "an object with a field for each material to change")
    defaults = default_materials(partial, default)
    _check_names(("materials",), partial, defaults, "material")
    return {name: _complete_material(name, partial.get(name, defaults[name]), defaults, previous) for name in defaults}


def _complete_material(name: str, partial: Any, default: Mapping[str, Any], previous: Mapping[str, Any]) -> Any:
    before = previous.get(name, default[name])
    if partial is before or partial is default[name]:
        return partial
    pointer: Pointer = ("materials", name)
    # only a ground has `shadow_catcher`, and only glass has `glass`
    fields = _merge(pointer, partial, {**_OPTIONAL, **default[name]})
    if not isinstance(fields.get("shadow_catcher", True), bool):
        raise invalid_value((*pointer, "shadow_catcher"), fields["shadow_catcher"], "true or false")
    normals = _complete_normals((*pointer, "normal_map"), fields.pop("normal_map"))
    glass = _complete_glass((*pointer, "glass"), fields.pop("glass"), default[name].get("glass"))
    functions = _complete_basis_functions((*pointer, "basis_functions"), fields.pop("basis_functions"))
    terms = _complete_terms((*pointer, "terms"), fields["terms"], before["terms"])
    uv = complete_uv((*pointer, "uv"), fields.pop("uv"), terms)
    return {
        **fields,
        "terms": terms,
        **normals,
        **uv,
        **glass,
        **functions,
    }


def _complete_basis_functions(pointer: Pointer, partial: Any) -> dict[str, Any]:
    """Check the number of basis functions of a material; empty if it is automatic."""
    if partial is None:
        return {}
    allowed = get_args(BasisFunctions)
    if isinstance(partial, bool) or partial not in allowed:
        raise invalid_value(pointer, partial, f"null, or one of {', '.join(map(str, allowed))}")
    return {"basis_functions": int(partial)}


def _complete_glass(pointer: Pointer, partial: Any, default: Mapping[str, Any] | None) -> dict[str, Any]:
    """Complete the glass of a material: null is the scene's own; empty if it is opaque."""
    if partial is not None:
        return {"glass": complete_glass(pointer, partial, default)}
    return {} if default is None else {"glass": default}


def _complete_normals(pointer: Pointer, partial: Any) -> dict[str, Any]:
    """Complete the image that replaces a material's normal map; empty if there is none."""
    if partial is None:
        return {}
    fields = _merge(pointer, partial, {"image": None, "scale": 1.0})
    check_number((*pointer, "scale"), fields["scale"], *NORMAL_SCALE)
    return {"normal_map": {**fields, "image": check_image((*pointer, "image"), fields["image"])}}


def _complete_terms(pointer: Pointer, partial: Any, previous: Sequence[Any]) -> list[Any]:
    if not isinstance(partial, list | tuple) or len(partial) > MAX_TERMS:
        raise invalid_value(pointer, partial, f"a list of at most {MAX_TERMS} terms")
    previous_terms = [*previous, *[None] * (len(partial) - len(previous))]
    terms = [
        term
        if term is previous_term and previous_term is not None
        else complete_term((*pointer, k), term, previous_term)
        for k, (term, previous_term) in enumerate(zip(partial, previous_terms, strict=False))
    ]
    check_shared(pointer, terms)
    return terms


def _complete_environment(
    partial: Any, default: Mapping[str, Any], previous: Mapping[str, Any], material_names: Collection[str]
) -> dict[str, Any]:
    # older stores have no map and no link
    fields = _merge(("environment",), partial, {**DEFAULTS["environment"], **default})
    if fields["map"] != previous.get("map"):
        _check_map(("environment", "map"), fields["map"])
    ranges = RANGES["environment"]
    check_number(("environment", "intensity"), fields["intensity"], *ranges["intensity"])
    check_triple(("environment", "color"), fields["color"], *ranges["color"])
    check_number(("environment", "rotation"), fields["rotation"], *ranges["rotation"])
    check_link(("environment", "link"), fields["link"], material_names)
    return fields


def _check_map(pointer: Pointer, name: Any) -> None:
    if name is not None and not (isinstance(name, str) and environment_exists(name)):
        available = names_text(environment_names())
        raise invalid_value(pointer, name, f"null for the scene's own, or an available environment: {available}")


def _complete_background(partial: Any, default: Mapping[str, Any]) -> dict[str, Any]:
    pointer = ("background",)
    fields = _merge(pointer, partial, {**DEFAULTS["background"], **default})  # older stores have no background
    if fields["kind"] not in get_args(BackgroundKind):
        raise invalid_value((*pointer, "kind"), fields["kind"], f"one of {names_text(get_args(BackgroundKind))}")
    check_triple((*pointer, "color"), fields["color"], *RANGES["background"]["color"])
    check_number((*pointer, "blur"), fields["blur"], *RANGES["background"]["blur"])
    return fields


def _complete_transport(partial: Any, default: Mapping[str, Any]) -> dict[str, Any]:
    pointer = ("transport",)
    fields = _merge(pointer, partial, {**DEFAULTS["transport"], **default})  # older stores have no transport
    if fields["show"] not in get_args(PathFilter):
        raise invalid_value((*pointer, "show"), fields["show"], f"one of {names_text(get_args(PathFilter))}")
    bounces = fields["bounces"]
    if not isinstance(bounces, int) or isinstance(bounces, bool) or not 0 <= bounces <= MAX_BOUNCES:
        raise invalid_value((*pointer, "bounces"), bounces, f"a whole number from 0 to {MAX_BOUNCES}")
    return fields


def _complete_display(partial: Any, default: Mapping[str, Any], previous: Mapping[str, Any]) -> dict[str, Any]:
    fields = _merge(("display",), partial, {**DEFAULTS["display"], **default})  # older stores have fewer
    for name, allowed in RANGES["display"].items():
        check_number(("display", name), fields[name], *allowed)
    _check_tone_map(("display", "tone_map"), fields["tone_map"])
    if fields["lut"] != previous.get("lut"):
        _check_lut(("display", "lut"), fields["lut"])
    return fields


def _check_lut(pointer: Pointer, name: Any) -> None:
    if name is not None and not (isinstance(name, str) and LUTS.exists(name)):
        raise invalid_value(pointer, name, f"null, or an uploaded LUT: {names_text(LUTS.list_names())}")


def _check_tone_map(pointer: Pointer, value: Any) -> None:
    """Check the form only. Looks move between servers, so the renderer reports a view that its config lacks."""
    is_name = isinstance(value, str) and value in get_args(ToneMap)
    is_view = isinstance(value, Mapping) and value.keys() == {"display", "view"}
    if is_view:
        is_view = all(isinstance(name, str) and _is_printable_name(name) for name in value.values())
    if not (is_name or is_view):
        views = "or a view of an OpenColorIO config, {display, view}"
        raise invalid_value(pointer, value, f"one of {names_text(get_args(ToneMap))}, {views}")


def _is_printable_name(name: str) -> bool:
    return 0 < len(name) <= MAX_NAME and name.isprintable()  # a lone surrogate cannot be encoded as UTF-8


def _merge(pointer: Pointer, partial: Any, default: Mapping[str, Any]) -> dict[str, Any]:
    check_object(pointer, partial, default)
    return {**default, **partial}


def _check_names(pointer: Pointer, partial: Any, default: Mapping[str, Any], label: str) -> None:
    if not isinstance(partial, Mapping):
        raise invalid_value(pointer, partial, f"an object with a field for each {label} to change")
    unknown = partial.keys() - default.keys()
    if unknown:
        name = min(unknown, key=str)
        raise ParameterError(
            "/".join(["", *map(str, pointer)]), name, f"a {label} of this scene: {names_text(default)}"
        )
