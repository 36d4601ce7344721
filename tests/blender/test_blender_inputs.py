"""Odd .blend files and servers: omissions are said, and nothing half done stays. Needs bpy: `make blender-check`."""

from __future__ import annotations

import json
import os
import subprocess
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from editor_server import Server

from relume_client import Client

Blender = Any
PROBLEM = {"type": "urn:relume:problem:access", "title": "Access", "status": 401, "detail": "The token is not valid."}
ADDON = Path(__file__).resolve().parents[2] / "dist" / "relume-blender-0.1.0.zip"


@pytest.fixture
def answering() -> Iterator[Any]:
    """A server that gives one answer to every call: status, content type, body."""
    servers = []

    def start(status: int, kind: str, body: str) -> str:
        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(status)
                self.send_header("Content-Type", kind)
                self.end_headers()
                self.wfile.write(body.encode())

            def log_message(self, *_: Any) -> None:
                pass

        servers.append(HTTPServer(("127.0.0.1", 0), Handler))
        threading.Thread(target=servers[0].serve_forever, daemon=True).start()
        return f"http://127.0.0.1:{servers[0].server_address[1]}"

    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


def use(url: str, token: str = "") -> str:
    addon = "bpy.context.preferences.addons['relume_blender'].preferences"
    return f"{addon}.url, {addon}.token = {url!r}, {token!r}\n"


def test_refused_token_and_other_servers_are_said(blender: Blender, answering: Any) -> None:
    url = answering(401, "application/problem+json", json.dumps(PROBLEM))
    refused = blender.run("make_scene()\n" + use(url, "wrong") + "result = run('send')")
    assert refused["status"] == "The token is not valid. (the token is in the preferences of the add-on)"
    assert refused["sent"] == ""


def test_page_of_another_program_is_no_server(blender: Blender, answering: Any) -> None:
    other = blender.run("make_scene()\n" + use(answering(404, "text/html", "<html>")) + "result = run('send')")
    assert "there is no relume server, or one of another version" in other["status"]


@pytest.mark.parametrize(
    ("url", "sentence"),
    [
        ("http://127.0.0.1:9", "is not available"),
        ("ftp://127.0.0.1", "is not the address of a server"),
        ("https://relume.example.org", "Online access is switched off"),
    ],
)
def test_server_that_is_away_is_said(blender: Blender, url: str, sentence: str) -> None:
    state = "result = [run('send'), sorted(scene.name for scene in bpy.data.scenes), len(bpy.data.cameras)]"
    blender.run("import relume_blender.operators; relume_blender.operators._RETRY_S = 0.1")
    failed, scenes, cameras = blender.run("make_scene()\n" + use(url) + state)
    assert sentence in failed["status"]
    assert [failed["sent"], scenes, cameras] == ["", ["Scene"], 1]


def test_pull_needs_a_scene_and_a_look(blender: Blender) -> None:
    assert "was not sent yet" in blender.run("make_scene(); result = run('pull')")["status"]
    before = blender.run("run('send'); result = lights()")
    for name in ("no such look", "a/b", "/?share=aaaaaaaaaa"):
        pulled = blender.run(f"bpy.context.scene.relume.look = {name!r}; result = run('pull')")
        assert pulled["status"], name
        assert not pulled["status"].startswith("Pulled")
    assert blender.run("result = lights()") == before


def test_empty_scene_is_not_sent(blender: Blender, blender_server: Server) -> None:
    assert blender.run("result = run('send')")["status"] == "The scene has no surfaces to show: add a mesh."


def test_names_that_clash_or_are_odd_come_back(blender: Blender, blender_server: Server) -> None:
    names = ["a/b", "a-b", 'say "hi" ~', "灯 😀", "Key"]
    source = f"""
        make_scene()
        for index, name in enumerate({names!r}):
            bpy.ops.mesh.primitive_plane_add(size=1, location=(index, 2, 1))
            bpy.context.object.data.materials.append(material(name, (0.5, 0.5, 0.5), 0.5))
        light("a/b", "POINT", (0, 0, 3), energy=10)
        result = run("send")
    """
    sent = json.loads(blender.run(source)["sent"])
    assert {*names, "Ball", "Floor"} == set(sent["materials"].values())
    look = {"materials": {}, "lights": {}}
    client = Client(blender_server.url)
    bake = client.bake(sent["bake"])
    document = json.loads(json.dumps(bake.look(sent["look"]).to_document()))
    for number, (name, blender_name) in enumerate(sent["materials"].items()):
        if blender_name in names:
            document["materials"][name]["terms"][1]["params"]["roughness"] = 0.11 + 0.1 * number
            look["materials"][blender_name] = 0.11 + 0.1 * number
    link = bake.share(document)
    status = blender.run(f"bpy.context.scene.relume.look = {link!r}; result = run('pull')")["status"]
    assert status == "Pulled look of the link: 5 materials, 0 lights."
    values = blender.run(f"result = {{name: values(name)['Roughness'] for name in {names!r}}}")
    assert values == pytest.approx(look["materials"], abs=1e-3)


def test_left_out_parts_are_named(blender: Blender) -> None:
    sent = blender.run("""
        make_scene()
        bpy.ops.object.volume_add() if hasattr(bpy.ops.object, "volume_add") else None
        tree = bpy.data.materials["Ball"].node_tree
        noise = tree.nodes.new("ShaderNodeTexNoise")
        shader = node_of(bpy.data.materials["Ball"], "BSDF_PRINCIPLED")
        tree.links.new(noise.outputs["Color"], shader.inputs["Base Color"])
        shader.inputs["Subsurface Weight"].default_value = 0.5
        floor = bpy.data.materials["Floor"].node_tree
        toon = floor.nodes.new("ShaderNodeBsdfToon")
        floor.links.new(toon.outputs[0], floor.get_output_node("ALL").inputs["Surface"])
        bpy.data.lights["Key"].shadow_soft_size = 0.2
        bpy.data.lights["Panel"].spread = 1.0
        bpy.data.lights["Panel"].shape = "DISK"
        bpy.context.scene.camera.data.dof.use_dof = True
        modifier = bpy.data.objects["Cube"].modifiers.new("Array", "ARRAY")
        modifier.count = 3
        result = run("send")
    """)
    text = "\n".join(sent["omitted"])
    for sentence in (
        "Base Color of material “Ball” comes from Noise Texture, which glTF cannot hold",
        "The subsurface scattering of material “Ball” is left out.",
        "material “Floor” has the shader Toon BSDF, not a Principled BSDF",
        "Lights “Key” have sharp shadows",
        "The spread of area light “Panel” is left out",
        "Area light “Panel” becomes a rectangle of the area of its ellipse.",
        "The depth of field of “Cam” is left out.",
    ):
        assert sentence in text


def test_modifiers_and_instances_are_sent(blender: Blender, blender_server: Server) -> None:
    sent = blender.run("""
        make_scene()
        bpy.data.objects["Cube"].modifiers.new("Array", "ARRAY").count = 3
        collection = bpy.data.collections.new("Group")
        bpy.ops.mesh.primitive_plane_add(size=1)
        plane = bpy.context.object
        bpy.context.scene.collection.objects.unlink(plane)
        collection.objects.link(plane)
        collection.objects.link(bpy.data.objects.new("Inner", bpy.data.lights.new("Inner", "POINT")))
        for x in (0, 5):
            group = bpy.data.objects.new("Instance", None)
            group.instance_type, group.instance_collection, group.location = "COLLECTION", collection, (x, 0, 2)
            bpy.context.scene.collection.objects.link(group)
        bpy.context.view_layer.update()
        result = run("send")
    """)
    record = json.loads(sent["sent"])
    assert Client(blender_server.url).scene(record["scene"]).info["triangles"] == 2 + 3 * 12 + 2 * 2
    positions = [light["position"] for name, light in record["look"]["lights"].items() if name.startswith("Inner")]
    np.testing.assert_allclose(sorted(positions), [[0, 2, 0], [5, 2, 0]], atol=1e-6)


def test_library_material_is_sent_and_not_changed(blender: Blender, blender_server: Server, tmp_path: Path) -> None:
    library = str(tmp_path / "library.blend")
    sent = blender.run(f"""
        linked = material("Linked", (0.2, 0.4, 0.6), 0.5)
        bpy.data.libraries.write({library!r}, {{linked}})
        bpy.data.materials.remove(linked)
        make_scene()
        with bpy.data.libraries.load({library!r}, link=True) as (source, target):
            target.materials = ["Linked"]
        bpy.data.objects["Cube"].data.materials[0] = target.materials[0]
        result = run("send")
    """)
    assert any("is linked from a library" in sentence for sentence in sent["omitted"])
    record = json.loads(sent["sent"])
    bake = Client(blender_server.url).bake(record["bake"])
    look = json.loads(json.dumps(bake.look(record["look"]).to_document()))
    look["materials"]["Linked"]["terms"][1]["params"]["roughness"] = 0.9
    link = bake.share(look)
    pulled = blender.run(f"bpy.context.scene.relume.look = {link!r}; result = run('pull')")
    assert "Material “Linked” is linked from a library: its changes are left out." in pulled["omitted"]
    assert blender.run("result = values('Linked')['Roughness']") == 0.5


def test_pull_is_one_undo_step(blender: Blender, blender_server: Server) -> None:
    record = json.loads(blender.run("make_scene(); result = run('send')")["sent"])
    bake = Client(blender_server.url).bake(record["bake"])
    look = json.loads(json.dumps(bake.look(record["look"]).to_document()))
    look["materials"]["Ball"]["terms"][1]["params"]["roughness"] = 0.6
    look["lights"]["Key"]["intensity"] = 3.0
    source = f"""
        bpy.context.scene.relume.look = {bake.share(look)!r}
        bpy.ops.ed.undo_push(message="before")
        run("pull")
        bpy.ops.ed.undo_push(message="Pull look")
        state = lambda: [values("Ball")["Roughness"], bpy.data.lights["Key"].energy]
        pulled = state()
        bpy.ops.ed.undo()
        result = [pulled, state(), "UNDO" in bpy.types.RELUME_OT_pull.bl_options]
    """
    pulled, undone, has_step = blender.run(source)
    assert pulled == pytest.approx([0.6, 180], 1e-4)
    assert undone == pytest.approx([0.35, 60], 1e-4)
    assert has_step


@pytest.mark.parametrize(("turn", "columns"), [(0.0, 0), (np.pi / 2, 16)])
def test_world_image_has_its_strength_and_rotation(blender: Blender, tmp_path: Path, turn: float, columns: int) -> None:
    pixels = np.arange(64 * 32 * 3, dtype=np.float32).reshape(32, 64, 3) / 1000  # the bottom row first, as in Blender
    np.save(tmp_path / "pixels.npy", np.concatenate([pixels, np.ones((32, 64, 1), np.float32)], axis=2))
    rows, warnings = blender.run(f"""
        import numpy as np
        import relume_blender.read_world as read_world
        from pathlib import Path
        image = bpy.data.images.new("World", 64, 32, float_buffer=True)
        image.pixels.foreach_set(np.load({str(tmp_path / "pixels.npy")!r}).ravel())
        image.pack()
        world = bpy.data.worlds.new("World")
        bpy.context.scene.world = world
        world.use_nodes = True
        tree, background = world.node_tree, node_of(world, "BACKGROUND")
        texture, mapping, place = (tree.nodes.new("ShaderNode" + n) for n in ("TexEnvironment", "Mapping", "TexCoord"))
        texture.image, texture.interpolation = image, "Closest"
        mapping.inputs["Rotation"].default_value[2] = {turn}
        tree.links.new(place.outputs["Generated"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
        tree.links.new(texture.outputs["Color"], background.inputs["Color"])
        background.inputs["Strength"].default_value = 2.0
        path = Path({str(tmp_path)!r}) / "world.exr"
        key, intensity, omitted = read_world.write_world(bpy.context, path)
        written = bpy.data.images.load(str(path))
        written.colorspace_settings.name = "Non-Color"
        data = np.array(written.pixels[:]).reshape(written.size[1], written.size[0], -1)[..., :3]
        step = written.size[0] // 64
        result = [data[step // 2 :: step, step // 2 :: step].tolist(), [intensity, *omitted]]
    """)
    assert warnings == [1.0]
    np.testing.assert_allclose(rows, 2 * np.roll(pixels, columns, axis=1), rtol=1e-3, atol=1e-4)


def test_black_world_is_dark(blender: Blender, blender_server: Server) -> None:
    """Also a scene without a world."""
    sent = blender.run("make_scene(); bpy.context.scene.world = None; result = run('send')")
    record = json.loads(sent["sent"])
    client = Client(blender_server.url)
    assert client.bake(record["bake"]).look(record["look"]).environment.intensity == 0
    lit = blender.run("bpy.context.scene.world = bpy.data.worlds['World']; result = run('send_changes')")
    again = json.loads(lit["sent"])
    assert lit["status"] == "Sent 0 materials, 0 lights, the world."
    assert client.bake(again["bake"]).look(again["look"]).environment.intensity == 1


def test_missing_cycles_is_said(blender: Blender) -> None:
    sent = blender.run("""
        import addon_utils
        make_scene()
        addon_utils.disable("cycles")
        result = run("send")
        addon_utils.enable("cycles")
    """)
    assert sent["status"] == "The world could not be rendered: switch the add-on Cycles Render Engine on."
    assert blender.run("result = [scene.name for scene in bpy.data.scenes]") == ["Scene"]


def test_restarted_server_takes_changes(blender: Blender, blender_server: Server) -> None:
    first = json.loads(blender.run("make_scene(); result = run('send')")["sent"])
    blender_server.kill()
    blender_server.start()
    changed = blender.run("bpy.data.lights['Key'].energy = 30; result = run('send_changes')")
    assert changed["status"] == "Sent 0 materials, 1 lights."
    assert json.loads(changed["sent"])["bake"] == first["bake"]


def test_scene_that_the_server_deleted_is_sent_anew(blender: Blender, blender_server: Server) -> None:
    first = json.loads(blender.run("make_scene(); result = run('send')")["sent"])
    Client(blender_server.url).scene(first["scene"]).delete()
    changed = blender.run("bpy.data.lights['Key'].energy = 31; result = run('send_changes')")
    assert changed["status"] == "A new scene was sent."


def test_extension_installs_without_network(blender_server: Server, tmp_path: Path) -> None:
    if not ADDON.is_file():
        pytest.skip("the extension is not built here (make blender-addon builds it)")
    source = f"""
import bpy
print(bpy.ops.extensions.package_install_files(filepath={str(ADDON)!r}, repo="user_default", enable_on_install=True))
import relume_client
print("CLIENT", relume_client.__file__, hasattr(bpy.types.Scene, "relume"))
"""
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path), "PYTHONPATH": ""}
    command = [os.environ["RELUME_BLENDER_PYTHON"], "-c", source]
    output = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=240, check=True).stdout
    assert f"CLIENT {tmp_path}" in output
    assert output.strip().endswith("True")
