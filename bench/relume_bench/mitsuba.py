"""Render scenes with Mitsuba 3, in its own environment.

`python3 -m venv bench/.venv-peers` and `bench/.venv-peers/bin/pip install mitsuba numpy`, or set RELUME_PEERS_PYTHON to
an interpreter with it. DRJIT_LIBLLVM_PATH is the LLVM library if it is not found under /usr/lib.
"""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
from numpy.typing import NDArray

from relume.brdf.term_validation import complete_term
from relume.core.digest import digest
from relume.scene.model import Glass, Scene

F32 = NDArray[np.float32]

_FINE_ROWS = 2048  # maximum rows of a resampled map, n times its own
_MAX_SPP_PER_PASS = 32  # at once; more would not fit in memory


def missing() -> str | None:
    """Reason why Mitsuba cannot run here; None if it can."""
    if _interpreter() is None:
        return "Mitsuba is not installed; bench/relume_bench/mitsuba.py describes the installation"
    if _llvm() is None:
        return "there is no LLVM library; install libllvm19 or set DRJIT_LIBLLVM_PATH"
    return None


def _interpreter() -> Path | None:
    default = Path(__file__).parents[1] / ".venv-peers" / "bin" / "python"
    python = Path(os.environ.get("RELUME_PEERS_PYTHON", default))
    return python if python.is_file() else None


def _llvm() -> str | None:
    libraries = sorted(map(str, Path("/usr/lib").glob("*/libLLVM*19*")))
    return os.environ.get("DRJIT_LIBLLVM_PATH") or (libraries[0] if libraries else None)


def bsdf(terms: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Terms of a material as a plugin of peer_mitsuba_plugins.py.

    Args:
        terms: `lambert` terms and at most one `blinn_phong`, `ggx` or dielectric `cook_torrance`, or one `oren_nayar`;
            without textures.
    """
    whole = [complete_term(("mitsuba",), term, None) for term in terms]
    diffuse = np.sum([term["color"] for term in whole if term["model"] == "lambert"] or [[0.0] * 3], axis=0).tolist()
    lobes = [term for term in whole if term["model"] != "lambert"]
    if lobes and lobes[0]["model"] == "oren_nayar":
        params = lobes[0]["params"]
        return {
            "type": "oren_nayar", "albedo": diffuse, "gain": lobes[0]["color"], "sigma": params["sigma"],
            "facet_albedo": params["albedo"],
        }  # fmt: skip
    if lobes and lobes[0]["model"] == "cook_torrance":
        params = lobes[0]["params"]
        return {
            "type": "lambert_cook_torrance", "albedo": diffuse, "gain": lobes[0]["color"],
            "sigma": params["sigma"], "ior": params["ior"],
        }  # fmt: skip
    if lobes and lobes[0]["model"] == "ggx":
        params = lobes[0]["params"]
        return {
            "type": "lambert_ggx", "albedo": diffuse, "gain": lobes[0]["color"], "roughness": params["roughness"],
            "f0": np.broadcast_to(params["f0"], 3).tolist(), "diffuse_share": 0.5 if any(diffuse) else 0.0,
        }  # fmt: skip
    glossy, exponent = (lobes[0]["color"], lobes[0]["params"]["exponent"]) if lobes else ([0.0] * 3, 1.0)
    # a highlight reflects up to four times its color
    diffuse_fraction = sum(diffuse) / max(1e-9, sum(diffuse) + 4 * sum(glossy))
    return {
        "type": "lambert_blinn_phong", "albedo": diffuse, "gain": glossy, "exponent": exponent,
        "diffuse_share": diffuse_fraction,
    }  # fmt: skip


def dielectric(glass: Glass) -> dict[str, Any]:
    """Glass as a Mitsuba plugin, with the medium inside a solid."""
    if glass.thickness == 0:
        tint = {"type": "rgb", "value": list(glass.tint)}
        return {"type": "thindielectric", "int_ior": glass.ior, "specular_transmittance": tint}
    max_absorption = max(*glass.absorbed, 1e-9)
    rate = {"type": "rgb", "value": [absorbed / max_absorption for absorbed in glass.absorbed]}
    rough = {} if glass.roughness == 0 else {"alpha": glass.roughness**2, "distribution": "ggx"}
    inside = {"type": "homogeneous", "albedo": 0.0, "scale": max_absorption, "sigma_t": rate}
    kind = "roughdielectric" if rough else "dielectric"
    return {"type": kind, "int_ior": glass.ior, "interior": inside, **rough}


def map_for_mitsuba(radiance: F32) -> F32:
    """Resample an environment map for Mitsuba: row j of R is at θ = π j/(R − 1), the first and last at the poles.

    A finer row lies within one of ours, or on the border of two, and is their mean then. Columns are unchanged.

    Args:
        radiance: (height, width, 3)
    Returns:
        (n · height + 1, n · width, 3), n from 2 to 8.
    """
    height = len(radiance)
    finer = min(8, max(2, _FINE_ROWS // height))
    row = np.arange(finer * height + 1)
    above, below = np.maximum(row - 1, 0) // finer, np.minimum(row, finer * height - 1) // finer
    return np.asarray(0.5 * (radiance[above] + radiance[below]), np.float32).repeat(finer, axis=1)


def read_passes(folder: Path) -> F32:
    """Read the independent images that `render` made. (passes, height, width, 3)"""
    return np.asarray(np.load(folder / "passes.npy", allow_pickle=False), np.float32)


def cached_passes(
    scene: Scene, size: tuple[int, int], job: Mapping[str, Any], images: Mapping[str, F32] | None = None
) -> F32:
    """Independent images of a job, rendered once for each scene, job and version of the peer's scripts.

    They are stored in the folder `peers` of the user's cache, which may be removed.

    Args:
        scene, size, job, images: as for `render`; images are of the scene's textures.
    Returns:
        (passes, height, width, 3).
    """
    return cache_passes((scene.id, size, job), lambda folder: render(scene, size, job, folder, images))


def cache_passes(key: Any, make: Callable[[Path], Any], plugins: str = "plugins") -> F32:
    """The passes that `make` renders into a folder; stored for each key and version of the peer's scripts.

    Args:
        key: everything that the images depend on, for `digest`. make: writes passes.npy into its folder.
        plugins: peer_mitsuba_NAME.py that has the BSDFs.
    """
    scripts = [Path(__file__).with_name(f"peer_mitsuba_{name}.py").read_bytes() for name in (plugins, "render")]
    cached = platformdirs.user_cache_path("relume") / "peers" / f"{digest((key, scripts))}.npy"
    if not cached.is_file():
        cached.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=cached.parent) as folder:
            make(Path(folder))
            (Path(folder) / "passes.npy").replace(cached)
    return np.asarray(np.load(cached, allow_pickle=False), np.float32)


def averaged(fine: NDArray[Any], finer: int) -> NDArray[np.float64]:
    """Average an image with `finer` times as many pixels per side as the peer's. (h, w, 3) float64"""
    height, width, _ = fine.shape
    blocks = fine.reshape(height // finer, finer, width // finer, finer, 3)
    return np.asarray(blocks.mean(axis=(1, 3), dtype=np.float64))


def render(
    scene: Scene, size: tuple[int, int], job: Mapping[str, Any], folder: Path, images: Mapping[str, F32] | None = None
) -> dict[str, Any]:
    """Render the scene's first view with the peer, from arrays.

    Args:
        scene: to render. size: width and height, pixels.
        job: "spp", sample counts; "bsdfs", one per mesh; "passes" for independent passes; "crop", x, y, width and
            height of a part; "sampler", name of a plugin; "most", maximum count at once; "bounces" and "seen" for
            indirect light alone (peer_mitsuba_render.py); "integrator" for more than direct light; "emitters", lights
            besides the map; both are Mitsuba's own descriptions.
        folder: for exchanged files.
        images: that descriptions of materials refer to as {"array": name}. (height, width, 1) each
    Returns:
        Contents of result.json in `folder`.
    Raises:
        CalledProcessError: the peer failed.
    """
    arrays: dict[str, Any] = {}
    for k, mesh in enumerate(scene.meshes):
        arrays |= {f"positions_{k}": mesh.positions, f"normals_{k}": mesh.normals, f"faces_{k}": mesh.faces}
        arrays[f"uvs_{k}"] = mesh.uvs
    return render_arrays(arrays | dict(images or {}), scene, size, job, folder)


def render_arrays(
    arrays: Mapping[str, Any], scene: Scene, size: tuple[int, int], job: Mapping[str, Any], folder: Path
) -> dict[str, Any]:
    """Render surfaces given as arrays with the peer, with the camera and environment of a scene's first view.

    Args:
        arrays: "positions_k", "normals_k", "uvs_k" and "faces_k" of each surface, and arrays for descriptions.
        scene: scene with the camera and the environment.
        size, job, folder: as for `render`.
    """
    camera = scene.cameras[0]
    view = {"camera": camera.to_world, "environment": map_for_mitsuba(scene.environment.radiance)}
    return run_peer({**view, **arrays}, {"yfov": camera.yfov, "size": list(size), **job}, folder)


def run_peer(arrays: Mapping[str, Any], job: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Render a job with the peer.

    Args:
        arrays: surfaces, images, cameras and environments: scene.npz of peer_mitsuba_render.py.
        job: its job.json. folder: for exchanged files.
    Returns:
        Contents of result.json in `folder`.
    Raises:
        CalledProcessError: the peer failed.
    """
    np.savez(folder / "scene.npz", allow_pickle=False, **arrays)
    (folder / "job.json").write_text(json.dumps({"most": _MAX_SPP_PER_PASS, **job}))
    script = Path(__file__).with_name("peer_mitsuba_render.py")
    environment = {**os.environ, "DRJIT_LIBLLVM_PATH": str(_llvm())}
    command = [str(_interpreter()), "-I", str(script), str(folder)]
    subprocess.run(command, env=environment, check=True, timeout=3600)
    result: dict[str, Any] = json.loads((folder / "result.json").read_text())
    return result
