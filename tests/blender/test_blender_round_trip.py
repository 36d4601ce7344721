"""A scene made in Blender goes out, is relit, and comes back with the right values. Needs bpy: `make blender-check`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import httpx
import numpy as np
import pytest
from editor_server import Server

from relume_client import Bake, Client

SENT = "The scene is in relume: open it in the browser."
Blender = Any


@pytest.fixture
def client(blender_server: Server, monkeypatch: pytest.MonkeyPatch) -> Client:
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    return Client(blender_server.url, retry_seconds=5.0)


def send(blender: Blender) -> dict[str, Any]:
    sent = blender.run("make_scene(); result = run('send')")
    assert sent["status"] == SENT
    return dict(json.loads(sent["sent"]))


def save(server: Server, name: str, look: Mapping[str, Any]) -> None:
    httpx.put(f"{server.url}/api/looks/{name}", json=look, trust_env=False).raise_for_status()


def sent_look(client: Client, sent: Mapping[str, Any]) -> dict[str, Any]:
    """The complete look of the link."""
    look: dict[str, Any] = json.loads(json.dumps(client.bake(sent["bake"]).look(sent["look"]).to_document()))
    return look


def test_scene_has_the_right_lights_and_materials(blender: Blender, client: Client) -> None:
    sent = send(blender)
    look = sent_look(client, sent)
    bake: Bake = client.bake(sent["bake"])
    assert bake.info["recipe"]["views"] == ["cam"]
    key, panel, sun, spot = (look["lights"][name] for name in ("Key", "Panel", "Sun", "Spot"))
    assert [key["kind"], panel["kind"], sun["kind"], spot["kind"]] == ["point", "rectangle", "directional", "spot"]
    np.testing.assert_allclose(
        np.multiply(key["emission"], key["color"]), 60 / (4 * np.pi) * np.array([0.5, 0.4, 0.3]), 1e-5
    )
    np.testing.assert_allclose(key["position"], [1, 2, 2], atol=1e-6)
    np.testing.assert_allclose(panel["emission"], 40 / (np.pi * 0.5), 1e-5)
    np.testing.assert_allclose(sun["emission"], 0.5, 1e-5)
    np.testing.assert_allclose(spot["emission"], 80 / (4 * np.pi), 1e-5)
    np.testing.assert_allclose(spot["cone"][1], np.degrees(0.4), 1e-5)
    own = client.bake(sent["bake"]).look().to_document()["lights"]  # of the file, which other programs read, too
    for name in ("Key", "Sun", "Spot"):
        gains = [np.multiply(lights[name]["emission"], lights[name]["color"]) for lights in (own, look["lights"])]
        np.testing.assert_allclose(gains[0], gains[1], 1e-4)
    lambert, gloss = look["materials"]["Ball"]["terms"]
    assert gloss["params"]["roughness"] == pytest.approx(0.35, 1e-4)
    np.testing.assert_allclose(np.array(lambert["color"]) / lambert["color"][0], [1, 0.25, 0.125], 1e-3)


def test_edited_look_comes_back(blender: Blender, blender_server: Server, client: Client) -> None:
    look = sent_look(client, send(blender))
    before = blender.run("result = {'lights': lights(), 'Floor': values('Floor')}")
    lambert, gloss = look["materials"]["Ball"]["terms"]
    lambert["color"] = [0.5 * channel for channel in lambert["color"]]
    gloss["params"]["roughness"] = 0.6
    look["lights"]["Key"]["intensity"] = 2.0
    look["lights"]["Spot"]["color"] = [0.2, 0.4, 1.0]
    look["lights"]["Panel"] |= {"size": [2.0, 0.25], "position": [0.0, 2.0, 1.0]}
    look["lights"]["Sun"]["enabled"] = False
    look["lights"]["New"] = {"kind": "point", "position": [1.0, 2.0, 3.0], "emission": [3.0, 3.0, 1.5]}
    save(blender_server, "Edited", look)
    pulled = blender.run("result = run('pull')")
    assert pulled["status"] == "Pulled look “Edited”: 1 materials, 5 lights."
    after = blender.run("result = {'lights': lights(), 'Floor': values('Floor'), 'Ball': values('Ball')}")
    assert after["Floor"] == before["Floor"]
    ball, lights = after["Ball"], after["lights"]
    np.testing.assert_allclose(ball["Base Color"], [0.4, 0.1, 0.05, 1], 1e-3)
    assert [ball["Roughness"], ball["Metallic"], ball["IOR"]] == pytest.approx([0.6, 0.0, 1.5], 1e-3)
    assert lights["Key"]["energy"] == pytest.approx(120, 1e-4)
    np.testing.assert_allclose(lights["Key"]["color"], [0.5, 0.4, 0.3], 1e-5)
    assert lights["Spot"]["energy"] == pytest.approx(80, 1e-4)
    np.testing.assert_allclose(lights["Spot"]["color"], [0.2, 0.4, 1.0], 1e-4)
    assert lights["Spot"]["spot_blend"] == pytest.approx(0.3, 1e-4)
    panel = lights["Panel"]
    assert [panel["energy"], panel["size"], panel["size_y"]] == pytest.approx([40, 2.0, 0.25], 1e-4)
    rotation = [[row[:3] for row in state["lights"]["Panel"]["matrix"][:3]] for state in (before, after)]
    np.testing.assert_allclose(rotation[1], rotation[0], atol=1e-5)
    np.testing.assert_allclose([row[3] for row in panel["matrix"][:3]], [0, -1, 2], atol=1e-5)
    assert [lights["Sun"]["hidden"], before["lights"]["Sun"]["hidden"]] == [True, False]
    assert lights["New"]["energy"] == pytest.approx(3 * 4 * np.pi, 1e-4)
    np.testing.assert_allclose([row[3] for row in lights["New"]["matrix"][:3]], [1, -3, 2], atol=1e-5)


def test_unedited_look_changes_nothing(blender: Blender, blender_server: Server, client: Client) -> None:
    save(blender_server, "Plain", sent_look(client, send(blender)))
    state = "result = {'lights': lights(), 'Floor': values('Floor'), 'Ball': values('Ball')}"
    before = blender.run(state)
    assert blender.run("bpy.context.scene.relume.look = 'Plain'; result = run('pull')")["omitted"] == []
    assert blender.run(state) == before


def test_lights_that_a_look_lacks_are_hidden(blender: Blender, client: Client) -> None:
    bake = client.bake(send(blender)["bake"])
    link = bake.share()  # the look of the file, which has no area lights
    pulled = blender.run(f"bpy.context.scene.relume.look = {link!r}; result = run('pull')")
    assert pulled["omitted"] == ["Light “Panel” is not part of the look: it is hidden."]
    hidden = blender.run("result = sorted(name for name, light in lights().items() if light['hidden'])")
    assert hidden == ["Panel"]


def test_factors_of_images_are_multiplied(blender: Blender, blender_server: Server, client: Client) -> None:
    blender.run("""
        make_scene()
        image = bpy.data.images.new("Stripes", 4, 4)
        image.pixels = [0.8, 0.4, 0.2, 1.0, 0.1, 0.2, 0.4, 1.0] * 8
        image.pack()
        tree = bpy.data.materials["Ball"].node_tree
        node = tree.nodes.new("ShaderNodeTexImage"); node.image = image
        shader = node_of(bpy.data.materials["Ball"], "BSDF_PRINCIPLED")
        tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    """)
    sent = json.loads(blender.run("result = run('send')")["sent"])
    look = sent_look(client, sent)
    lambert = look["materials"]["Ball"]["terms"][0]
    assert lambert["texture"] == "diffuse"
    lambert["color"] = np.multiply(lambert["color"], [0.5, 1.0, 0.25]).tolist()
    save(blender_server, "Tinted", look)
    blender.run("bpy.context.scene.relume.look = 'Tinted'; result = run('pull')")
    factor = blender.run("""
        mix = node_of(bpy.data.materials["Ball"], "MIX")
        result = [list(s.default_value) for s in mix.inputs if s.enabled and s.type == "RGBA" and not s.is_linked]
    """)
    np.testing.assert_allclose(factor, [[0.5, 1.0, 0.25, 1.0]], 1e-3)
    again = json.loads(blender.run("result = run('send')")["sent"])
    factors = again["material_documents"]["Ball"]["pbrMetallicRoughness"]["baseColorFactor"]
    np.testing.assert_allclose(factors[:3], [0.5, 1.0, 0.25], 1e-3)


def test_changes_are_a_look_or_a_new_scene(blender: Blender, client: Client) -> None:
    sent = send(blender)
    assert blender.run("result = run('send_changes')")["status"] == "Nothing has changed."
    changed = blender.run("""
        node_of(bpy.data.materials["Ball"], "BSDF_PRINCIPLED").inputs["Roughness"].default_value = 0.7
        node_of(bpy.data.materials["Floor"], "BSDF_PRINCIPLED").inputs["Emission Color"].default_value = (1, 0.5, 0, 1)
        node_of(bpy.data.materials["Floor"], "BSDF_PRINCIPLED").inputs["Emission Strength"].default_value = 3
        bpy.data.lights["Key"].energy = 30
        bpy.data.objects.remove(bpy.data.objects["Spot"])
        node_of(bpy.context.scene.world, "BACKGROUND").inputs["Strength"].default_value = 2.0
        result = run("send_changes")
    """)
    assert changed["status"] == "Sent 2 materials, 3 lights, the world."
    again = json.loads(changed["sent"])
    assert [again["scene"], again["bake"]] == [sent["scene"], sent["bake"]]
    look = sent_look(client, again)
    assert look["materials"]["Ball"]["terms"][1]["params"]["roughness"] == pytest.approx(0.7, 1e-4)
    np.testing.assert_allclose(look["lights"]["Floor"]["emission"], [3, 1.5, 0], 1e-4)
    np.testing.assert_allclose(look["lights"]["Key"]["emission"], 30 / (4 * np.pi), 1e-4)
    assert look["lights"]["Spot"]["enabled"] is False
    assert look["environment"]["map"].startswith("env:")
    assert [scene.info["name"] for scene in client.scenes() if "materials" in scene.info["name"]] == []
    moved = blender.run("bpy.data.objects['Cube'].location.x += 1; result = run('send_changes')")
    assert moved["status"] == "A new scene was sent."
    assert json.loads(moved["sent"])["scene"] != sent["scene"]
