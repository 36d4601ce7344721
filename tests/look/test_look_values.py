"""Values of looks from any source: invalid ones are rejected with a pointer and the allowed range."""

from __future__ import annotations

import copy

import jsonpatch
import pytest
from example_look import CURVES, INF, MATERIALS, NAN, SIGMA, make_flat_curve
from tiny_scenes import make_camera, make_tiny_scene, quad, studio

from relume.core.errors import ParameterError
from relume.look import apply_patch, default_look, validate
from relume.look.glass import glass_of, with_glass
from relume.look.model import GlassLook
from relume.scene.model import Glass, Light, Material


@pytest.mark.parametrize(
    ("path", "value", "pointer", "allowed"),
    [
        ("", [], "the look", "an object"),
        ("", {"material": {}}, "/material", "'materials'"),
        ("/materials", 3, "/materials", "material"),
        ("/transport", {"depth": 3}, "/transport/depth", "'bounces'"),
        ("/transport/show", "shadows", "/transport/show", "'further_bounces'"),
        ("/transport/show", ["all"], "/transport/show", "'further_bounces'"),
        *(("/transport/bounces", bad, "/transport/bounces", "0 to 24") for bad in (-1, 25, 1.5, True, None, NAN)),
        ("/materials", {"Cup": {}}, "/materials", "'Teapot'"),
        ("/materials/Teapot", None, "/materials/Teapot", "an object"),
        ("/materials/Teapot/terms", {}, "/materials/Teapot/terms", "at most 16"),
        ("/materials/Teapot/terms", [{"model": "lambert"}] * 17, "/materials/Teapot/terms", "at most 16"),
        ("/materials/Teapot/terms/1", {}, "/materials/Teapot/terms/1/model", "'cook_torrance'"),
        ("/materials/Teapot/terms/1/model", "velvet", "/materials/Teapot/terms/1/model", "'cook_torrance'"),
        ("/materials/Teapot/terms/1/model", ["ggx"], "/materials/Teapot/terms/1/model", "'cook_torrance'"),
        ("/materials/Teapot/terms/1/texture", "bump", "/materials/Teapot/terms/1/texture", "'specular'"),
        ("/materials/Teapot/terms/1/color", [1, 1], "/materials/Teapot/terms/1/color", "three numbers"),
        ("/materials/Teapot/terms/1/color", [1, 1, -0.1], "/materials/Teapot/terms/1/color/2", "[0, 10000]"),
        ("/materials/Teapot/terms/1/color", [1, NAN, 1], "/materials/Teapot/terms/1/color/1", "[0, 10000]"),
        ("/materials/Teapot/terms/1/color", [True, 1, 1], "/materials/Teapot/terms/1/color/0", "[0, 10000]"),
        ("/materials/Teapot/terms/1/params", {"roughness": 1}, "/materials/Teapot/terms/1/params/roughness", "'sigma'"),
        ("/materials/a~1b~0c/terms/0/params/f0", [1, 2, 0], "/materials/a~1b~0c/terms/0/params/f0/1", "[0, 1]"),
        *((SIGMA, bad, SIGMA, "[0.005, 2]") for bad in (0, 2.5, NAN, INF, -INF, True, None, "0.2", 10**400, [], {})),
        (CURVES, {"theta_i": {"points": make_flat_curve(3)}}, f"{CURVES}/theta_i", "'theta_h'"),
        (f"{CURVES}/theta_h", 7, f"{CURVES}/theta_h", "an object"),
        (f"{CURVES}/theta_h", {}, f"{CURVES}/theta_h", "points or bands"),
        (f"{CURVES}/theta_h", {"points": make_flat_curve(3), "bands": []}, f"{CURVES}/theta_h", "points or bands"),
        (f"{CURVES}/theta_h", {"points": make_flat_curve(3), "x": 1}, f"{CURVES}/theta_h/x", "leave it out"),
        (f"{CURVES}/theta_h", {"points": make_flat_curve(4097)}, f"{CURVES}/theta_h/points", "2 to 4096"),
        (f"{CURVES}/theta_h", {"points": make_flat_curve(20_000)}, f"{CURVES}/theta_h/points", "2 to 4096"),
        (f"{CURVES}/theta_h", {"points": [[0, 1]]}, f"{CURVES}/theta_h/points", "2 to 4096"),
        (f"{CURVES}/theta_h", {"points": [[0, 1], [0, 2]]}, f"{CURVES}/theta_h/points/1/0", "greater"),
        (f"{CURVES}/theta_h", {"points": [[0, 1], [1e-300, 2]]}, f"{CURVES}/theta_h/points/1/0", "greater"),
        (f"{CURVES}/theta_h", {"points": [[3, 1], [2, 2]]}, f"{CURVES}/theta_h/points/1/0", "greater"),
        (f"{CURVES}/theta_h", {"points": [[0, 1], [91, 2]]}, f"{CURVES}/theta_h/points/1/0", "[0, 90]"),
        (f"{CURVES}/theta_h", {"points": [[0, 1], [NAN, 2], [80, 1]]}, f"{CURVES}/theta_h/points/1/0", "[0, 90]"),
        (f"{CURVES}/theta_h", {"points": [[0, 1.0], [5, NAN]]}, f"{CURVES}/theta_h/points/1/1", "[0, 1e+06]"),
        (f"{CURVES}/theta_h", {"points": [[0, 1.0], [5, INF]]}, f"{CURVES}/theta_h/points/1/1", "[0, 1e+06]"),
        (f"{CURVES}/theta_h", {"points": [[0, False], [5, 1]]}, f"{CURVES}/theta_h/points/0/1", "[0, 1e+06]"),
        (f"{CURVES}/theta_h", {"points": [[0, 1], [5, 10**400]]}, f"{CURVES}/theta_h/points/1/1", "[0, 1e+06]"),
        (f"{CURVES}/theta_h", {"points": [[0, 1], [5]]}, f"{CURVES}/theta_h/points/1", "a point"),
        (f"{CURVES}/theta_h", {"points": ["ab", "cd"]}, f"{CURVES}/theta_h/points/0", "a point"),
        (f"{CURVES}/theta_h", {"points": "0123"}, f"{CURVES}/theta_h/points", "2 to 4096"),
        (f"{CURVES}/theta_h", {"channels": "r"}, f"{CURVES}/theta_h", "'handles'"),
        (f"{CURVES}/theta_h", {"handles": make_flat_curve(3)}, f"{CURVES}/theta_h/handles/0", "a handle"),
        (f"{CURVES}/theta_h", {"handles": [[0, 1, 1]]}, f"{CURVES}/theta_h/handles", "2 to 4096"),
        (f"{CURVES}/theta_h", {"handles": [[0, 1, 1], [0, 1, 1]]}, f"{CURVES}/theta_h/handles/1/0", "greater"),
        (f"{CURVES}/theta_h", {"handles": [[0, 1, 1], [9, 1, INF]]}, f"{CURVES}/theta_h/handles/1/2", "[0, 1e+06]"),
        (f"{CURVES}/theta_h", {"handles": [[0, -1, 1], [9, 1, 1]]}, f"{CURVES}/theta_h/handles/0/1", "[0, 1e+06]"),
        (f"{CURVES}/theta_h", {"factors": [1.0] * 64}, f"{CURVES}/theta_h/factors", "256 values"),
        (f"{CURVES}/theta_h", {"offsets": [1.0] * 255 + [-1.0]}, f"{CURVES}/theta_h/offsets/255", "[0, 1e+06]"),
        (f"{CURVES}/theta_h", {"bands": [1.0] * 255}, f"{CURVES}/theta_h/bands", "256 values"),
        (f"{CURVES}/theta_h", {"bands": [[1.0] * 256] * 2}, f"{CURVES}/theta_h/bands", "256 values"),
        (f"{CURVES}/theta_h", {"bands": [1.0] * 255 + [NAN]}, f"{CURVES}/theta_h/bands/255", "[0, 1e+06]"),
        (
            f"{CURVES}/theta_h",
            {"bands": [[1.0] * 256, [1.0] * 256, [1.0] * 9 + [-1.0] * 247]},
            f"{CURVES}/theta_h/bands/2/9",
            "[0, 1e+06]",
        ),
        *(
            (
                f"{CURVES}/theta_h",
                {"points": make_flat_curve(3), "channels": bad},
                f"{CURVES}/theta_h/channels",
                "letters",
            )
            for bad in ("", "rgba", "rr", 1, ["r"])
        ),
        (f"{CURVES}/theta_h", [], f"{CURVES}/theta_h", "one to three"),
        (
            f"{CURVES}/theta_h",
            [{"points": make_flat_curve(3), "channels": "r"}] * 4,
            f"{CURVES}/theta_h",
            "one to three",
        ),
        (
            f"{CURVES}/theta_h",
            [{"points": make_flat_curve(3), "channels": "rg"}, {"points": make_flat_curve(3), "channels": "gb"}],
            f"{CURVES}/theta_h/1/channels",
            "no other object",
        ),
        ("/environment/intensity", -1, "/environment/intensity", "[0, 10000]"),
        ("/environment/color", [1, -1, 1], "/environment/color/1", "[0, 10000]"),
        ("/environment/color", 0.5, "/environment/color", "three numbers"),
        ("/environment/rotation", 1e9, "/environment/rotation", "[-360, 360]"),
        ("/environment/map", "env:0123456789abcdef", "/environment/map", "'studio'"),
        ("/environment/map", "../studio", "/environment/map", "null for the scene's own"),
        ("/environment/map", ["studio"], "/environment/map", "'sunset'"),
        ("/environment/tilt", 1, "/environment/tilt", "'rotation'"),
        ("/lights", [], "/lights", "each light"),
        ("/lights", {f"L{k}": {"kind": "point"} for k in range(63)}, "/lights", "at most 64"),
        ("/lights/Moon", 3, "/lights/Moon", "an object"),
        ("/lights/Moon", {}, "/lights/Moon/kind", "'point'"),
        ("/lights/Moon", {"kind": ["point"]}, "/lights/Moon/kind", "'point'"),
        ("/lights/Moon", {"kind": "mesh", "material": "Teapot"}, "/lights/Moon/material", "'Panel'"),
        ("/lights/Moon", {"kind": "mesh"}, "/lights/Moon/material", "'Teapot'"),
        ("/lights/Moon", {"kind": "mesh", "material": ["Cup"]}, "/lights/Moon/material", "'Teapot'"),
        ("/lights/Moon", {"kind": "mesh", "material": "a/b~c", "image": "image:0"}, "/lights/Moon/image", "uploaded"),
        ("/lights/Moon", {"kind": "mesh", "material": "a/b~c", "image": 3}, "/lights/Moon/image", "uploaded"),
        ("/lights/Panel/image", "../x", "/lights/Panel/image", "uploaded"),
        ("/lights/Key", {"kind": "mesh", "material": "Cup"}, "/lights/Key/kind", "'spot'"),
        ("/lights/" + "x" * 81, {"kind": "point"}, "/lights/" + "x" * 80, "1 to 80"),
        ("/lights/Moon", {"kind": "point", "cone": [1, 2]}, "/lights/Moon/cone", "'position'"),
        ("/lights/Moon", {"kind": "point", "emission": [1, -1, 1]}, "/lights/Moon/emission/1", "[0, 1e+12]"),
        ("/lights/Moon", {"kind": "rectangle", "size": [1, 0]}, "/lights/Moon/size/1", "[1e-08, 1e+08]"),
        ("/lights/Moon", {"kind": "disc", "radius": 0}, "/lights/Moon/radius", "[0.0001, 10000]"),
        ("/lights/Moon", {"kind": "sphere", "radius": [1]}, "/lights/Moon/radius", "[0.0001, 10000]"),
        ("/lights/Moon", {"kind": "sphere", "direction": [0, 1, 0]}, "/lights/Moon/direction", "'radius'"),
        ("/lights/Moon", {"kind": "tube", "length": -1}, "/lights/Moon/length", "[0.0001, 10000]"),
        ("/lights/Moon", {"kind": "directional", "angle": 31}, "/lights/Moon/angle", "[0, 30]"),
        ("/lights/Moon", {"kind": "rectangle", "rotation": 361}, "/lights/Moon/rotation", "[-360, 360]"),
        ("/lights/Key/enabled", 1, "/lights/Key/enabled", "true or false"),
        ("/lights/Key/intensity", NAN, "/lights/Key/intensity", "[0, 10000]"),
        ("/lights/Key/size", [1, 1], "/lights/Key/size", "'cone'"),
        ("/lights/Key/position", [0, INF, 0], "/lights/Key/position/1", "[-1e+09, 1e+09]"),
        ("/lights/Key/position", [0, 1], "/lights/Key/position", "three numbers"),
        ("/lights/Key/direction", [0, 0, 1e-30], "/lights/Key/direction", "not all zero"),
        ("/lights/Key/cone", [20], "/lights/Key/cone", "two numbers"),
        ("/lights/Key/cone", [0, 0], "/lights/Key/cone", "above 0"),
        ("/lights/Key/cone", [40, 30], "/lights/Key/cone", "inner ≤ outer"),
        ("/lights/Key/cone", [20, 91], "/lights/Key/cone/1", "[0, 90]"),
        ("/lights/Key/kind", "mesh", "/lights/Key/kind", "'spot'"),
        ("/lights/Panel/kind", "point", "/lights/Panel/kind", "'mesh'"),
        ("/lights/Panel/material", "a/b~c", "/lights/Panel/material", "'Teapot'"),
        ("/lights/Panel/position", [0, 0, 0], "/lights/Panel/position", "'material'"),
        ("/display/exposure", 21, "/display/exposure", "[-20, 20]"),
        ("/display/tone_map", "reinhard", "/display/tone_map", "'agx'"),
        ("/display/tone_map", {"a": 1}, "/display/tone_map", "'agx'"),
        ("/display/tone_map", {"display": "a", "view": ""}, "/display/tone_map", "view of an OpenColorIO config"),
        ("/display/tone_map", {"display": "a", "view": "b" * 257}, "/display/tone_map", "view of an OpenColorIO"),
        ("/display/tone_map", {"display": "a", "view": "b", "c": "c"}, "/display/tone_map", "view of an OpenColorIO"),
        ("/display/tone_map", {"display": "\ud800", "view": "b"}, "/display/tone_map", "view of an OpenColorIO"),
    ],
)
def test_an_invalid_value_is_rejected_with_its_pointer_and_range(default, path, value, pointer, allowed):
    before = copy.deepcopy(default)
    with pytest.raises(ParameterError) as raised:
        apply_patch(default, [{"op": "add", "path": path, "value": value}], default)
    assert raised.value.name == pointer
    assert allowed in raised.value.allowed
    assert len(str(raised.value)) < 600
    assert "\n" not in str(raised.value)
    assert default == before
    # the whole document, as from a file or a PUT, is rejected, too
    document = jsonpatch.apply_patch(default, [{"op": "add", "path": path, "value": value}])
    with pytest.raises(ParameterError) as raised:
        validate(document, default)
    assert raised.value.name == pointer


def test_a_scene_with_an_invalid_term_is_rejected_with_its_pointer():
    with pytest.raises(ParameterError) as raised:
        default_look([Material("Cup", ({"model": "ggx", "params": {"roughness": 0.0}},))])
    assert raised.value.name == "/materials/Cup/terms/0/params/roughness"


@pytest.mark.parametrize(
    ("fields", "pointer"),
    [
        ({}, "/lights/A/kind"),
        ({"kind": ["spot"]}, "/lights/A/kind"),
        ({"kind": "mesh", "material": "Cup"}, "/lights/A/material"),
        ({"kind": "spot", "size": [1, 1]}, "/lights/A/size"),
    ],
)
def test_a_scene_with_an_invalid_light_is_rejected_with_its_pointer(fields, pointer):
    with pytest.raises(ParameterError) as raised:
        default_look(MATERIALS, [Light("A", fields)])
    assert raised.value.name == pointer


WHITE = Material("White", ({"model": "lambert"},))
GLASS = Material("Glass", ({"model": "lambert"},), glass=Glass(tint=(0.5, 0.6, 0.7), ior=1.4))
SOLID = Material("Solid", ({"model": "lambert"},), glass=Glass(thickness=0.1, absorbed=(1.0, 2.0, 3.0)))


@pytest.mark.parametrize(
    ("path", "value", "pointer", "allowed"),
    [
        *(("/Glass/glass/ior", bad, "/Glass/glass/ior", "[1, 4]") for bad in (0.5, 4.5, NAN, INF, None, "1.5", True)),
        *(("/Glass/glass/roughness", bad, "/Glass/glass/roughness", "[0, 1]") for bad in (2, -0.1, NAN, [0.1] * 3)),
        ("/Glass/glass/color", [0.5, -0.1, 0.5], "/Glass/glass/color/1", "[0, 1]"),
        ("/Glass/glass/color", [0.5, 0.5, NAN], "/Glass/glass/color/2", "[0, 1]"),
        ("/Glass/glass/color", [1.1, 1, 1], "/Glass/glass/color/0", "[0, 1]"),
        ("/Glass/glass/color", 0.5, "/Glass/glass/color", "three numbers"),
        ("/Glass/glass", 3, "/Glass/glass", "an object"),
        ("/Glass/glass/thickness", 1.0, "/Glass/glass/thickness", "'roughness'"),
        ("/Glass/glass/absorption", [1, 1, 1], "/Glass/glass/absorption", "'color'"),  # thin glass has none
        ("/Solid/glass/absorption", [1, 1, -1], "/Solid/glass/absorption/2", "[0, 1e+06]"),
        ("/White/glass", {"ior": 1.5}, "/White/glass", "transmits no light"),
    ],
)
def test_invalid_glass_is_rejected_with_a_pointer(path, value, pointer, allowed):
    default = default_look([WHITE, GLASS, SOLID])
    patch = [{"op": "add", "path": f"/materials{path}", "value": value}]
    with pytest.raises(ParameterError) as error:
        apply_patch(default, patch, default)
    assert f"/materials{pointer}" in str(error.value)
    assert allowed in str(error.value)


def test_glass_of_the_scene_is_the_default_and_is_completed():
    default = default_look([WHITE, GLASS, SOLID])
    assert "glass" not in default["materials"]["White"]
    assert default["materials"]["Glass"]["glass"] == {"color": [0.5, 0.6, 0.7], "roughness": 0.0, "ior": 1.4}
    edited = validate({"materials": {"Solid": {"glass": {"ior": 2.0}}, "Glass": {"glass": None}}}, default)
    assert edited.materials["Solid"].glass == GlassLook(color=(1, 1, 1), absorption=(1, 2, 3), roughness=0, ior=2)
    assert edited.materials["Glass"] == validate({}, default).materials["Glass"]


def test_a_scene_with_the_glass_of_a_look_keeps_what_the_look_does_not_edit():
    scene = make_tiny_scene(
        quad("pane", [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], 1),
        camera=make_camera("front", (0, 0, 3), (0, 0, 0), 0.6), environment=studio(), materials=[WHITE, GLASS, SOLID],
    )  # fmt: skip
    default = default_look(scene.materials)
    assert with_glass(scene, glass_of(validate({}, default))) is scene
    edited = with_glass(scene, glass_of(validate({"materials": {"Solid": {"glass": {"ior": 2.0}}}}, default)))
    assert edited.materials[:2] == scene.materials[:2]
    assert edited.materials[2].glass == Glass(ior=2.0, thickness=0.1, absorbed=(1.0, 2.0, 3.0))
    assert edited.id.startswith(scene.id)
    assert edited.id != scene.id
