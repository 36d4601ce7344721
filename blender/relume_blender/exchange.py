"""Calls of a server: send a scene, send its changes, pull a look. Nothing here touches Blender."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from relume_client import AsyncClient, ProblemError
from relume_client.async_client import AsyncScene

from .glb import Glb, Json, material_swatches
from .lights import changed_fields, from_look
from .snapshot import Sent, Snapshot
from .surfaces import Value, fit_sentences, principled_values

Report = Callable[[str, float], object]
"""Gets a text and progress from 0 to 1."""
_REJECTED = 422
_NO_EMISSION = [0.0, 0.0, 0.0]


@dataclass(frozen=True)
class BakeSettings:
    """Method (`direct`, `gather` or `probes`) and preset of a bake."""

    method: str = "gather"
    preset: str = "good"


@dataclass(frozen=True)
class PulledLook:
    """Changes of a look since the scene was sent.

    Attributes:
        name: of the look. materials: values of Principled BSDFs by name of the material in looks.
        lights: complete lights of the look that are new or changed, with the former one or None.
        removed: names of lights that the look no longer has. omitted: sentences about what is left out.
    """

    name: str
    materials: Mapping[str, Mapping[str, Value]]
    lights: Mapping[str, tuple[Json | None, Json]]
    removed: tuple[str, ...]
    omitted: tuple[str, ...]


async def send(client: AsyncClient, url: str, snapshot: Snapshot, settings: BakeSettings, report: Report) -> Sent:
    """Import the scene, bake it and share its look. A new scene is deleted again if any of these fails.

    Args:
        client, url: of the server. snapshot: to be sent. settings: of the bake. report: gets progress.
    Raises:
        RelumeClientError: with a sentence for users.
    """
    report("Sending the scene", 0.0)
    former = {scene.id for scene in await client.scenes()}
    scene = await _import(client, snapshot, former)
    try:
        options: dict[str, Any] = {"preset": settings.preset}
        if snapshot.views:
            options["views"] = snapshot.views
        bake = await scene.bake(settings.method, **options)
        await bake.wait(progress=lambda body: report("Baking", 0.1 + 0.85 * body.get("progress", 0.0)))
        report("Sharing the look", 0.95)
        link = await bake.share(snapshot.look)
    except BaseException:
        if scene.id not in former:
            await scene.delete()
        raise
    return Sent(
        url, scene.id, bake.id, link, snapshot.look, snapshot.key, snapshot.environment_key, snapshot.materials,
        snapshot.lights, snapshot.material_documents,
    )  # fmt: skip


async def _import(client: AsyncClient, snapshot: Snapshot, former: set[str]) -> AsyncScene:
    """Import the scene. Once it is on its way, a cancellation waits for it, so that it can be deleted."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.glb"
        path.write_bytes(snapshot.glb.to_bytes())
        call = client.import_scene(path, environment=snapshot.environment, name=snapshot.name, recenter="never")
        upload = asyncio.ensure_future(call)
        try:
            return await asyncio.shield(upload)
        except asyncio.CancelledError:
            scene = await upload
            if scene.id not in former:
                await scene.delete()
            raise


async def send_changes(
    client: AsyncClient, url: str, snapshot: Snapshot, sent: Sent | None, settings: BakeSettings, report: Report
) -> tuple[Sent, str]:
    """Send what has changed: materials, lights and environment as a look, all else as a new scene.

    Args:
        client, url: of the server. snapshot: to be sent. sent: the record of the last one; None if there is none.
        settings: of the bake. report: gets progress.
    Returns:
        The new record, and a sentence about what was sent.
    Raises:
        RelumeClientError: with a sentence for users.
    """
    if sent is not None and (sent.url, sent.key) == (url, snapshot.key):
        try:
            return await _send_look(client, snapshot, sent, report)
        except ProblemError as problem:
            if problem.kind != "not-found" and problem.status != _REJECTED:
                raise
    return await send(client, url, snapshot, settings, report), "A new scene was sent."


async def _send_look(client: AsyncClient, snapshot: Snapshot, sent: Sent, report: Report) -> tuple[Sent, str]:
    former, current = sent.material_documents, snapshot.material_documents
    changed = [name for name, material in current.items() if former.get(name) != material]
    look: Json = {**sent.look, **snapshot.look}
    report("Sending materials and lights", 0.1)
    bake = await client.bake(sent.bake)
    if changed:
        terms = await _terms(client, snapshot)
        materials = {name: {"terms": terms[name]} for name in changed}
        look["materials"] = {**look.get("materials", {}), **materials}
    look["lights"] = {**_without_removed(sent.look["lights"], snapshot), **look["lights"]}
    look["lights"] |= _emissions(sent.look["lights"], former, current)
    look["environment"] = {**sent.look["environment"], **snapshot.look["environment"]}
    if snapshot.environment_key != sent.environment_key:
        report("Sending the environment", 0.5)
        look["environment"]["map"] = await client.import_environment(snapshot.environment, name=snapshot.name)
    num_lights = sum(sent.look["lights"].get(name) != light for name, light in look["lights"].items())
    if look == sent.look:
        return sent, "Nothing has changed."
    report("Sharing the look", 0.9)
    link = await bake.share(look)
    renewed = replace(
        sent, link=link, look=look, environment_key=snapshot.environment_key, materials=snapshot.materials,
        lights=snapshot.lights, material_documents=current,
    )  # fmt: skip
    world = ", the world" if look["environment"] != sent.look["environment"] else ""
    return renewed, f"Sent {len(changed)} materials, {num_lights} lights{world}."


def _without_removed(lights: Mapping[str, Json], snapshot: Snapshot) -> dict[str, Json]:
    """Lights of the former look; those that Blender no longer has are off."""
    return {
        name: light if light["kind"] == "mesh" or name in snapshot.lights else {**light, "enabled": False}
        for name, light in lights.items()
    }


def _emissions(lights: Mapping[str, Json], former: Mapping[str, Json], current: Mapping[str, Json]) -> dict[str, Json]:
    """Lights of the materials whose emission has changed; images of emission are part of the scene."""
    changed = {}
    for name, material in current.items():
        emission = _emission(material)
        if "emissiveTexture" not in material and emission != _emission(former.get(name, {})):
            light = {"kind": "mesh", "material": name, "emission": emission, "enabled": any(emission)}
            changed[name] = {**lights.get(name, {}), **light}
    return changed


def _emission(material: Json) -> list[float]:
    strength = material.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
    return [strength * channel for channel in material.get("emissiveFactor", _NO_EMISSION)]


async def _terms(client: AsyncClient, snapshot: Snapshot) -> dict[str, Any]:
    """Terms of the materials, which the server makes of a small scene, so that one reader has all of glTF's rules."""
    former = {scene.id for scene in await client.scenes()}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "materials.glb"
        path.write_bytes(material_swatches(snapshot.glb).to_bytes())
        scene = await client.import_scene(path, name=f"{snapshot.name}: materials", recenter="never")
    try:
        return {material["name"]: material["terms"] for material in scene.info["materials"]}
    finally:
        if scene.id not in former:
            await scene.delete()


async def pull(client: AsyncClient, sent: Sent, name: str, report: Report) -> PulledLook:
    """Read a look, and what of it differs from the sent one.

    Args:
        client: of the server. sent: the record of the scene.
        name: of a saved look, or a share link; empty for the look that was saved last. report: gets progress.
    Raises:
        RelumeClientError: with a sentence for users. LookupError: there is no saved look.
    """
    report("Reading the look", 0.0)
    label, document = await _find_look(client, name)
    bake = await client.bake(sent.bake)
    old: Any = (await bake.look(sent.look)).to_document()
    new: Any = (await bake.look(document)).to_document()
    old_lights, new_lights = old["lights"], new["lights"]
    edited = {name for name, material in new["materials"].items() if material != old["materials"].get(name)}
    emitters = [(name, light) for name, light in new_lights.items() if light["kind"] == "mesh"]
    edited |= {light["material"] for name, light in emitters if light != old_lights.get(name)}
    omitted = _omitted(old, new, edited)
    materials = dict[str, dict[str, Value]]()
    if edited:
        report("Reading materials", 0.3)
        documents = await _exported_materials(client, sent, new)
        materials = {name: principled_values(documents[name]) for name in sorted(edited) if name in documents}
        for name in materials.keys() & _brighter_than_images(new):
            del materials[name]["Base Color"]  # the factor is in the pixels of the exported image
            omitted.append(f"Material “{name}” is brighter than its image, which Blender's exporter cannot write.")
        omitted += [sentence for name in materials for sentence in fit_sentences(documents[name])]
    lights = {
        name: (old_lights.get(name), light)
        for name, light in new_lights.items()
        if light["kind"] != "mesh" and light != old_lights.get(name)
    }
    removed = tuple(name for name in old_lights if name not in new_lights)
    return PulledLook(label, materials, lights, removed, tuple(omitted))


async def _find_look(client: AsyncClient, name: str) -> tuple[str, Any]:
    """Name and document of a saved look or of a share link."""
    text = name.strip()
    if share := parse_qs(urlsplit(text).query).get("share"):
        return "of the link", await client.shared_look(share[0])
    if not text:
        saved = await client.saved_looks()
        if not saved:
            raise LookupError("The server has no saved look: save one in the editor, or paste a share link.")
        text = max(saved, key=lambda entry: entry["modified"])["name"]
    return f"“{text}”", await client.saved_look(text)


async def _exported_materials(client: AsyncClient, sent: Sent, look: Any) -> dict[str, Json]:
    """Materials of a look as glTF has them, by name; the server fits them."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "look.glb"
        await (await client.scene(sent.scene)).export(path, look)
        exported = Glb.from_bytes(path.read_bytes())
    return {material["name"]: material for material in exported.document.get("materials", ())}


def _brighter_than_images(look: Any) -> set[str]:
    """Materials whose images are multiplied by more than 1."""
    return {
        name
        for name, material in look["materials"].items()
        if any(
            term.get("texture") and max(term["color"]) > 1 for term in material["terms"] if term["model"] == "lambert"
        )
    }


def _omitted(old: Any, new: Any, edited: set[str]) -> list[str]:
    """Sentences about changes of a look that are not pulled."""
    sections = [section for section in ("environment", "background", "display") if old[section] != new[section]]
    sentences = [f"The {section} of the look differs; it is not pulled." for section in sections]
    for name in sorted(edited & new["materials"].keys()):
        images = [term.get(slot) for term in new["materials"][name]["terms"] for slot in ("texture", "roughness_map")]
        images.append((new["materials"][name].get("normal_map") or {}).get("image"))
        if any(str(image).startswith("image:") for image in images):
            sentences.append(f"The images that relume has on material “{name}” are not pulled.")
    return sentences


def is_changed(before: Json | None, after: Json) -> set[str]:
    """Fields of Blender's light that differ between two lights of a look; all of them for a new light."""
    if before is None or before["kind"] != after["kind"]:
        return {"type", "power", "color", "to_world", "spot_size", "spot_blend", "size"}
    return changed_fields(from_look(before), from_look(after))
