"""USD stages: axes, units, transforms, polygons, primvars, subsets, instances, cameras."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from glb_builder import DIELECTRIC_TRANSMISSION
from texture_values import get_texture_values
from usd_text import BOUND, CHECKER, RGB, Files, imported, material, painted, quad, texture, usda

from relume.core.errors import SceneError
from relume.scene.model import Mesh, Scene
from relume.scene_io.import_options import ImportOptions
from relume.scene_io.placement import area, bounds
from relume.scene_io.usd import stage_reader

pytest.importorskip("pxr.Usd")


def corners(scene: Scene, mesh: int = 0) -> np.ndarray:
    """Positions of the corners of a mesh's triangles."""
    return scene.meshes[mesh].positions[scene.meshes[mesh].faces]


def face_normals(scene: Scene, mesh: int = 0) -> np.ndarray:
    a, b, c = corners(scene, mesh).transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.mark.parametrize(
    ("metadata", "options", "high", "normal"),
    [
        ("", ImportOptions(), [1, 1, 0], [0, 0, 1]),
        ('upAxis = "Z"\nmetersPerUnit = 0.01', ImportOptions(), [0.01, 0, 0.01], [0, 1, 0]),
        ('upAxis = "Z"\nmetersPerUnit = 0.01', ImportOptions(up="y"), [0.01, 0.01, 0], [0, 0, 1]),
        ('upAxis = "Z"\nmetersPerUnit = 0.01', ImportOptions(unit="m"), [1, 0, 1], [0, 1, 0]),
        ("metersPerUnit = 2.5", ImportOptions(unit="mm"), [0.001, 0.001, 0], [0, 0, 1]),
    ],
)
def test_up_axis_and_unit_are_those_of_the_file_unless_options_say_otherwise(
    metadata: str, options: ImportOptions, high: list[float], normal: list[float]
) -> None:
    scene = imported(usda(quad(), metadata), options=options)
    np.testing.assert_allclose(bounds(scene)[1], high, atol=1e-7)
    np.testing.assert_allclose(face_normals(scene)[0], normal, atol=1e-6)
    np.testing.assert_allclose(scene.meshes[0].normals[0], normal, atol=1e-6)


def test_transforms_of_all_ancestors_apply_in_order() -> None:
    inner = quad(properties='float xformOp:rotateZ = 90\nuniform token[] xformOpOrder = ["xformOp:rotateZ"]')
    outer = f"""
def Xform "Outer" {{
    double3 xformOp:translate = (10, 0, 0)
    float3 xformOp:scale = (2, 1, 1)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
    {inner}
}}"""
    scene = imported(usda(outer))
    # (-1, -1) rotates to (1, -1), is scaled to (2, -1), and moves
    np.testing.assert_allclose(corners(scene)[0, 0], [12, -1, 0], atol=1e-6)


def test_mirrored_and_left_handed_meshes_face_the_same_side() -> None:
    mirrored = 'float3 xformOp:scale = (-1, 1, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    normals = 'normal3f[] normals = [(0, 0, 1)] (\n interpolation = "constant"\n)'
    left = 'uniform token orientation = "leftHanded"'
    scene = imported(usda(quad("A", f"{mirrored}\n{normals}") + quad("B", left)))
    np.testing.assert_allclose(face_normals(scene, 0), [[0, 0, 1]] * 2, atol=1e-6)
    np.testing.assert_allclose(scene.meshes[0].normals, [[0, 0, 1]] * 6, atol=1e-6)
    np.testing.assert_allclose(face_normals(scene, 1), [[0, 0, -1]] * 2, atol=1e-6)
    np.testing.assert_allclose(scene.meshes[1].normals, [[0, 0, -1]] * 6, atol=1e-6)


def test_positions_far_from_the_origin_keep_their_shape() -> None:
    far = 'double3 xformOp:translate = (100000000, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    scene = imported(usda(quad(properties=far)))
    np.testing.assert_allclose(bounds(scene)[1], [1, 1, 0], atol=1e-6)
    assert scene.offset == (1e8, 0.0, 0.0)


PLANK = """
def Mesh "Plank" {
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
    uniform token subdivisionScheme = "none"
    %s
}"""
UVS = {
    "faceVarying": "[(0, 0), (1, 0), (1, 1), (0, 1), (0, 0), (.5, 0), (.5, 1), (0, 1)]",
    "vertex": "[(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)]",
    "uniform": "[(.25, .25), (.75, .75)]",
    "constant": "[(.5, .25)]",
}


@pytest.mark.parametrize(
    ("interpolation", "expected"),
    [
        ("faceVarying", [[0, 1], [0.5, 1], [0.5, 0]]),
        ("vertex", [[1, 1], [2, 1], [2, 0]]),
        ("uniform", [[0.75, 0.25]] * 3),
        ("constant", [[0.5, 0.75]] * 3),
    ],
)
def test_texture_coordinates_belong_to_corners_points_faces_or_all(
    interpolation: str, expected: list[list[float]]
) -> None:
    primvar = f'texCoord2f[] primvars:st = {UVS[interpolation]} (\n interpolation = "{interpolation}"\n)'
    plank = PLANK % f"{primvar}\nrel material:binding = </Paint>"
    scene = imported(usda(plank + material(RGB, texture("Image", "checker.png"))), Files({"checker.png": CHECKER}))
    mesh = scene.meshes[0]
    np.testing.assert_allclose(mesh.uvs[mesh.faces[2]], expected)  # the first triangle of the second face


def test_indexed_primvars_and_wrong_indices() -> None:
    primvar = """texCoord2f[] primvars:st = [(0, 0), (1, 1)] (
        interpolation = "faceVarying"
    )
    int[] primvars:st:indices = [0, 1, 0, 7]"""
    layer = usda(painted(RGB, texture("Image", "checker.png"), primvar))
    scene = imported(layer, Files({"checker.png": CHECKER}))
    mesh = scene.meshes[0]
    np.testing.assert_allclose(mesh.uvs[mesh.faces[0]], [[0, 1], [1, 0], [0, 1]])
    assert any("1 corners of mesh “Quad” have no valid value of “st”" in warning for warning in scene.warnings)


def test_concave_faces_holes_and_faces_without_points() -> None:
    arrow = """
def Mesh "Arrow" {
    int[] faceVertexCounts = [4, 3, 3]
    int[] faceVertexIndices = [0, 1, 2, 3, 0, 1, 2, 0, 1, 9]
    int[] holeIndices = [1]
    point3f[] points = [(0, 0, 0), (2, 2, 0), (0, 1, 0), (-2, 2, 0)]
    uniform token subdivisionScheme = "none"
}"""
    scene = imported(usda(arrow))
    assert sum(len(mesh.faces) for mesh in scene.meshes) == 2
    assert area(scene) == pytest.approx(2.0)
    assert [str(w) for w in scene.warnings if w.severity == "unsupported"] == [
        "Left out 1 face of the USD file: vertices do not exist or are not numbers."
    ]


def test_normals_are_the_files_or_flat_or_smooth() -> None:
    tilted = 'normal3f[] normals = [(1, 0, 1), (0, 0, 2), (0, 0, 1), (0, 1, 0)] (\n interpolation = "vertex"\n)'
    first = imported(usda(quad(properties=tilted))).meshes[0].normals
    np.testing.assert_allclose(first[:2], [[np.sqrt(0.5), 0, np.sqrt(0.5)], [0, 0, 1]], atol=1e-6)
    roof = (PLANK % "").replace("(1, 0, 0)", "(1, 0, .2)").replace("(1, 1, 0)", "(1, 1, .2)")
    flat = imported(usda(roof))
    np.testing.assert_allclose(flat.meshes[0].normals, np.repeat(face_normals(flat), 3, axis=0), atol=1e-6)


def test_subsets_have_their_materials_and_the_rest_that_of_the_mesh() -> None:
    subset = """def GeomSubset "Right" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    ) {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </Red>
    }"""
    plank = PLANK % f"rel material:binding = </Paint>\n{subset}"
    scene = imported(usda(plank + material("") + material("color3f inputs:diffuseColor = (1, 0, 0)", name="Red")))
    shown = {scene.materials[mesh.material].name: bounds_of(mesh) for mesh in scene.meshes}
    assert shown == {"Red": (1.0, 2.0), "Paint": (0.0, 1.0)}


def bounds_of(mesh: Mesh) -> tuple[float, float]:
    """Lowest and highest x of a mesh."""
    return float(mesh.positions[:, 0].min()), float(mesh.positions[:, 0].max())


INSTANCER = """
def PointInstancer "Trees" {
    int[] protoIndices = [0, 1, 0, 5]
    point3f[] positions = [(0, 0, 0), (5, 0, 0), (10, 0, 0), (0, 0, 0)]
    quath[] orientations = [(1, 0, 0, 0), (1, 0, 0, 0), (0.70710678, 0, 0, 0.70710678), (1, 0, 0, 0)]
    float3[] scales = [(1, 1, 1), (2, 2, 2), (1, 3, 1), (1, 1, 1)]
    rel prototypes = [</Trees/A, </Trees/B>]
    %s
    def Xform "A" {
        double3 xformOp:translate = (0, 0, 1)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        %s
    }
    def Xform "B" {
        %s
    }
}""".replace("</Trees/A,", "</Trees/A>,")


def test_point_instances_have_their_transforms_and_the_prototypes_own() -> None:
    scene = imported(usda(INSTANCER % ("int64[] invisibleIds = []", quad("InA"), quad("InB"))))
    boxes = sorted((mesh.positions.min(axis=0).tolist(), mesh.positions.max(axis=0).tolist()) for mesh in scene.meshes)
    expected = [([-1, -1, 1], [1, 1, 1]), ([3, -2, 0], [7, 2, 0]), ([7, -1, 1], [13, 1, 1])]
    np.testing.assert_allclose(boxes, expected, atol=2e-3)  # orientations have half precision
    assert any("1 instances of “Trees”: they have no prototype" in warning for warning in scene.warnings)


def test_masked_point_instances_are_not_shown() -> None:
    scene = imported(usda(INSTANCER % ("int64[] invisibleIds = [1, 2]", quad("InA"), quad("InB"))))
    assert len(scene.meshes) == 1


def test_native_instances_share_a_material() -> None:
    body = f"""
class Xform "Chair" {{
    {quad("Seat", "rel material:binding = </Chair/Paint>", BOUND)}
    {material("").replace("</Paint", "</Chair/Paint")}
}}
def Xform "First" (
    instanceable = true
    references = </Chair>
) {{
}}
def Xform "Second" (
    instanceable = true
    references = </Chair>
) {{
    double3 xformOp:translate = (5, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}"""
    scene = imported(usda(body))
    assert sorted(bounds_of(mesh) for mesh in scene.meshes) == [(-1, 1), (4, 6)]
    assert [m.name for m in scene.materials] == ["Paint"]


def test_invisible_proxies_guides_and_inactive_prims_are_not_shown() -> None:
    hidden = [
        'token visibility = "invisible"',
        'uniform token purpose = "proxy"',
        'uniform token purpose = "guide"',
    ]
    bodies = [quad(f"Hidden{k}", line) for k, line in enumerate(hidden)]
    inactive = quad("Inactive", metadata="active = false")
    shown = quad("Shown", 'uniform token purpose = "render"')
    scene = imported(usda("".join(bodies) + inactive + shown))
    assert [mesh.name for mesh in scene.meshes] == ["Shown"]


def test_values_are_those_of_the_first_time() -> None:
    moving = """double3 xformOp:translate.timeSamples = {10: (3, 0, 0), 20: (9, 0, 0)}
    uniform token[] xformOpOrder = ["xformOp:translate"]"""
    for metadata in ("", "startTimeCode = 10\nendTimeCode = 20"):
        scene = imported(usda(quad(properties=moving), metadata))
        assert bounds_of(scene.meshes[0]) == (2, 4)


def test_variants_are_those_selected_and_others_are_named() -> None:
    body = f"""
def Xform "Root" (
    variants = {{
        string shape = "small"
    }}
    prepend variantSets = "shape"
) {{
    variantSet "shape" = {{
        "large" {{
            {quad("Large")}
        }}
        "small" {{
            {quad("Small")}
        }}
    }}
}}"""
    scene = imported(usda(body))
    assert [mesh.name for mesh in scene.meshes] == ["Small"]
    assert list(scene.warnings) == ["“Root” is shown in its shape “small”; the file also has “large”."]
    assert scene.warnings[0].severity == "ignored"


@pytest.mark.parametrize(
    ("shape", "exact", "high"),
    [
        ('def Cube "C" {\ndouble size = 3\n}', 54.0, [1.5, 1.5, 1.5]),
        ('def Sphere "C" {\ndouble radius = 2\n}', 4 * np.pi * 4, [2, 2, 2]),
        ('def Cylinder "C" {\ndouble radius = 1\n double height = 3\n}', 2 * np.pi * 4, [1, 1, 1.5]),
        (
            'def Cylinder "C" {\ndouble radius = 1\n double height = 3\n uniform token axis = "X"\n}',
            2 * np.pi * 4,
            [1.5, 1, 1],
        ),
        ('def Cone "C" {\ndouble radius = 3\n double height = 4\n}', np.pi * 3 * 8, [3, 3, 2]),
        (
            'def Capsule "C" {\ndouble radius = 1\n double height = 2\n uniform token axis = "Y"\n}',
            2 * np.pi * 4,
            [1, 2, 1],
        ),
        ('def Plane "C" {\ndouble width = 3\n double length = 2\n uniform token axis = "Y"\n}', 6.0, [1.5, 0, 1]),
    ],
)
def test_implicit_shapes_have_their_size_and_face_outward(shape: str, exact: float, high: list[float]) -> None:
    scene = imported(usda(shape))
    assert area(scene) == pytest.approx(exact, rel=4e-3)
    np.testing.assert_allclose(bounds(scene)[1], high, atol=1e-6)
    centers, normals = corners(scene).mean(axis=1), face_normals(scene)
    if "Plane" in shape:
        np.testing.assert_allclose(normals, [[0, 1, 0]] * 2, atol=1e-6)
    else:
        assert ((centers * normals).sum(axis=1) > 0).all()
        np.testing.assert_array_less(0.9, (np.repeat(normals, 3, axis=0) * scene.meshes[0].normals).sum(axis=1))


def test_display_colors_without_a_material() -> None:
    red = 'color3f[] primvars:displayColor = [(1, 0, 0)] (\n interpolation = "constant"\n)'
    clear = "float[] primvars:displayOpacity = [0.25]"
    varied = """color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)] (
        interpolation = "vertex"
    )"""
    group = f"""def Xform "Group" {{
    {red}
    {quad("Inherits")}
}}"""
    scene = imported(usda(quad("Red", red) + group + quad("Clear", f"{red}\n{clear}") + quad("Varied", varied)))
    by_mesh = {mesh.name: scene.materials[mesh.material] for mesh in scene.meshes}
    assert by_mesh["Red"] is by_mesh["Inherits"]
    assert by_mesh["Red"].terms[0]["color"] == pytest.approx([DIELECTRIC_TRANSMISSION, 0, 0], abs=1e-5)
    assert by_mesh["Red"].opacity is None
    assert by_mesh["Clear"].opacity is not None
    assert by_mesh["Clear"].opacity.alpha.item() == 64
    mesh = next(mesh for mesh in scene.meshes if mesh.name == "Varied")
    values = get_texture_values(by_mesh["Varied"].textures["diffuse"])
    rows, columns = values.shape[:2]
    texels = (mesh.uvs[mesh.faces[0]] * [columns, rows]).astype(int)
    shown = values[texels[:, 1], texels[:, 0]]
    np.testing.assert_allclose(shown, np.eye(3), atol=0.02)


def test_cameras_have_their_depth_of_field_in_meters() -> None:
    body = """
def Camera "Sharp" {
    float focusDistance = 3
}
def Camera "Blurred" {
    float focalLength = 50
    float fStop = 2.5
    float focusDistance = 120
}
def Camera "Impossible" {
    float fStop = 2.8
    float focusDistance = -3
}
"""
    scene = imported(usda(quad() + body, "metersPerUnit = 0.01"))
    sharp, blurred, impossible = scene.cameras
    assert sharp.lens is None
    assert blurred.lens is not None
    assert blurred.lens.radius == pytest.approx(0.01)  # 50 mm at f/2.5: 20 mm across
    assert blurred.lens.focus_distance == pytest.approx(1.2)
    assert impossible.lens is None
    assert [warning for warning in scene.warnings if "“Impossible”" in warning and "focus_distance" in warning]
    inches = imported(usda(quad() + body, "metersPerUnit = 0.01"), options=ImportOptions(unit="in"))
    assert inches.cameras[1].lens is not None
    assert inches.cameras[1].lens.focus_distance == pytest.approx(120 * 0.0254)
    assert inches.cameras[1].lens.radius == pytest.approx(0.0254)


def test_cameras_have_their_aperture_and_pose() -> None:
    body = """
def Camera "Shot 1" {
    float focalLength = 50
    float horizontalAperture = 36
    float verticalAperture = 24
    double3 xformOp:translate = (1, 2, 3)
    float3 xformOp:rotateXYZ = (0, 90, 0)
    float3 xformOp:scale = (2, 2, 2)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale"]
}
def Camera "Top" {
    token projection = "orthographic"
}
""".replace("Shot 1", "Shot_1")
    scene = imported(usda(quad() + body, "metersPerUnit = 0.1"))
    (camera,) = scene.cameras
    assert camera.name == "shot-1"
    assert camera.yfov == pytest.approx(2 * np.arctan(12 / 50))
    assert camera.aspect == pytest.approx(1.5)
    np.testing.assert_allclose(camera.to_world[:3, 3], [0.1, 0.2, 0.3])
    np.testing.assert_allclose(-camera.to_world[:3, 2], [-1, 0, 0], atol=1e-9)
    assert "Skipped camera “Top”: only perspective cameras are supported." in scene.warnings


def test_a_broken_prim_costs_only_itself() -> None:
    broken = """
def Mesh "NoPoints" {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
}
def Mesh "Short" {
    int[] faceVertexCounts = [3, 3]
    int[] faceVertexIndices = [0, 1, 2, 0]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
}
def Mesh "NotNumbers" {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(nan, 0, 0), (1, 0, 0), (inf, 1, 0)]
    uniform token subdivisionScheme = "none"
}
def Mesh "Negative" {
    int[] faceVertexCounts = [-3, 3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
}
def BasisCurves "Hair" {
}
def Points "Dust" {
}
"""
    far = 'double3 xformOp:translate = (1e30, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    scene = imported(usda(broken + quad("Lost", far) + quad("Good")))
    assert [mesh.name for mesh in scene.meshes] == ["Short", "Negative", "Good"]
    assert [str(warning) for warning in scene.warnings if warning.severity == "unsupported"] == [
        "Skipped mesh “NoPoints”: it has no points or no faces.",
        "Left out 1 faces of mesh “Short”: no vertices.",
        "Left out 1 face of the USD file: vertices do not exist or are not numbers.",
        "Left out 1 faces of mesh “Negative”: no vertices.",
        "Skipped “Lost”: its transform is out of range.",
        "Skipped 1 prims: curves aren't supported.",
        "Skipped 1 prims: points aren't supported.",
    ]


def test_a_stage_without_triangles_says_why() -> None:
    with pytest.raises(SceneError, match=r"no triangles with an area.*Skipped mesh “Empty”: it has no points"):
        imported(usda('def Mesh "Empty" {\n}'))
    with pytest.raises(SceneError, match="the USD file is damaged"):
        imported(b"#usda 1.0\ndef Mesh {{{")


def test_too_many_prims_or_triangles_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    body = usda(INSTANCER % ("", quad("InA"), quad("InB")))
    monkeypatch.setattr(stage_reader, "MAX_INSTANCES", 2)
    with pytest.raises(SceneError, match="more than 2 meshes"):
        imported(body)
    monkeypatch.setattr(stage_reader, "MAX_PRIMS", 3)
    with pytest.raises(SceneError, match="more than 3 prims"):
        imported(body)


def test_without_usd_core_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pxr.Usd", None)
    with pytest.raises(SceneError, match=r"pip install relume\[usd\]"):
        imported(usda(quad()))


SKELETON = """
def SkelRoot "Figure" {
    def Skeleton "Bones" (
        prepend apiSchemas = ["SkelBindingAPI"]
    ) {
        uniform token[] joints = ["Hip"]
        uniform matrix4d[] bindTransforms = [((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))]
        uniform matrix4d[] restTransforms = [((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 4, 0, 1))]
    }
    %s
}"""


def test_skinned_meshes_are_in_their_pose() -> None:
    skin = """rel skel:skeleton = </Figure/Bones>
    int[] primvars:skel:jointIndices = [0] (
        interpolation = "constant"
        elementSize = 1
    )
    float[] primvars:skel:jointWeights = [1] (
        interpolation = "constant"
        elementSize = 1
    )"""
    scene = imported(usda(SKELETON % quad("Skin", skin, 'prepend apiSchemas = ["SkelBindingAPI"]')))
    np.testing.assert_allclose(bounds(scene)[0], [-1, 3, 0], atol=1e-6)


MOVING = """double3 xformOp:translate.timeSamples = {10: (3, 0, 0), 20: (9, 0, 0)}
    uniform token[] xformOpOrder = ["xformOp:translate"]"""


@pytest.mark.parametrize(("time", "x"), [(10.0, 3), (12.5, 4.5), (20.0, 9), (99.0, 9), (-5.0, 3)])
def test_the_time_code_of_the_options(time: float, x: float) -> None:
    for metadata in ("", "startTimeCode = 10\nendTimeCode = 15\ntimeCodesPerSecond = 5"):
        scene = imported(usda(quad(properties=MOVING), metadata), options=ImportOptions(time=time))
        assert bounds_of(scene.meshes[0]) == pytest.approx((x - 1, x + 1))
        assert scene.warnings == (f"The scene is shown at time code {time:g}; its animation has 10 to 20.",)


def test_animations_that_are_not_shown_are_said() -> None:
    """The range in the metadata does not matter: values may lie outside, or be missing."""
    ignored = ("The animation is ignored: the scene is shown at its first time.",)
    assert imported(usda(quad(properties=MOVING))).warnings == ignored
    assert imported(usda(quad(), "startTimeCode = 10\nendTimeCode = 20")).warnings == ()
    still = imported(usda(quad()), options=ImportOptions(time=3))
    assert still.warnings == ("The file has no animation; its time code 3 has no effect.",)


def test_skinned_meshes_follow_the_animation_of_their_skeleton() -> None:
    skin = """rel skel:skeleton = </Figure/Bones>
    int[] primvars:skel:jointIndices = [0] (
        interpolation = "constant"
        elementSize = 1
    )
    float[] primvars:skel:jointWeights = [1] (
        interpolation = "constant"
        elementSize = 1
    )"""
    walk = """def SkelAnimation "Walk" {
        uniform token[] joints = ["Hip"]
        float3[] translations.timeSamples = {0: [(0, 0, 0)], 10: [(0, 20, 0)]}
        quatf[] rotations = [(1, 0, 0, 0)]
        half3[] scales = [(1, 1, 1)]
    }"""
    figure = SKELETON % (quad("Skin", skin, 'prepend apiSchemas = ["SkelBindingAPI"]') + walk)
    figure = figure.replace(
        "uniform token[] joints", "rel skel:animationSource = </Figure/Walk>\n uniform token[] joints", 1
    )
    scene = imported(usda(figure), options=ImportOptions(time=2.5))
    np.testing.assert_allclose(bounds(scene)[0], [-1, 4, 0], atol=1e-5)
