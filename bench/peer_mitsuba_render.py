"""Renders a scene with Mitsuba 3 at rising sample counts; run by the peer's own interpreter, knows nothing of relume.

python -I peer_mitsuba_render.py FOLDER     reads scene.npz and job.json there, writes result.json and picture.npy, or
                                            passes.npy where the job asks for independent passes instead
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

mi: Any = __import__("mitsuba")
dr: Any = __import__("drjit")
mi.set_variant("llvm_ad_rgb")


class LambertCookTorrance(mi.BSDF):  # type: ignore[misc]
    """albedo/π + D F G / (4π cos θi cos θo), Beckmann facets, dielectric Fresnel, V-cavity masking.

    Samples the cosine and the facets half and half.
    """

    def __init__(self, props: Any) -> None:
        mi.BSDF.__init__(self, props)
        self.albedo, self.gain = float(props["albedo"]), float(props["gain"])
        self.sigma, self.ior = float(props["sigma"]), float(props["ior"])
        glossy = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
        self.m_components = [mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide, glossy]
        self.m_flags = self.m_components[0] | self.m_components[1]

    def _facets(self) -> Any:
        return mi.MicrofacetDistribution(mi.MicrofacetType.Beckmann, self.sigma, sample_visible=False)

    def _value(self, wi: Any, wo: Any) -> Any:
        """BRDF times the cosine towards the light, `wo` in Mitsuba's naming."""
        h = dr.normalize(wi + wo)
        cos_h, cos_d = mi.Frame3f.cos_theta(h), dr.maximum(dr.dot(h, wi), 1e-6)
        cos_o, cos_i = mi.Frame3f.cos_theta(wi), mi.Frame3f.cos_theta(wo)
        cos2 = cos_h * cos_h
        facets = dr.exp(-(1 - cos2) / (cos2 * self.sigma**2)) / (self.sigma**2 * cos2 * cos2)
        masking = dr.minimum(1, 2 * cos_h * dr.minimum(cos_i, cos_o) / cos_d)
        fresnel = mi.fresnel(cos_d, self.ior)[0]
        glossy = facets * fresnel * masking / (4 * dr.pi * cos_o)
        return self.albedo / dr.pi * cos_i + self.gain * glossy

    def _density(self, wi: Any, wo: Any) -> Any:
        h = dr.normalize(wi + wo)
        facets = self._facets().pdf(wi, h) / (4 * dr.maximum(dr.dot(wo, h), 1e-6))
        return 0.5 * (mi.warp.square_to_cosine_hemisphere_pdf(wo) + facets)

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        h, _ = self._facets().sample(si.wi, sample2)
        wo = dr.select(sample1 < 0.5, mi.warp.square_to_cosine_hemisphere(sample2), mi.reflect(si.wi, h))
        bs = mi.BSDFSample3f()
        bs.wo, bs.pdf = wo, self.pdf(ctx, si, wo, active)
        bs.eta, bs.sampled_component = 1.0, mi.UInt32(0)
        bs.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        usable = active & (bs.pdf > 0)
        return bs, dr.select(usable, self.eval(ctx, si, wo, usable) / dr.maximum(bs.pdf, 1e-12), 0)

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        above = active & (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(wo) > 0)
        return dr.select(above, mi.Color3f(self._value(si.wi, wo)), 0)

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        above = active & (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(wo) > 0)
        return dr.select(above, self._density(si.wi, wo), 0)

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def to_string(self) -> str:
        """Mitsuba's interface."""
        return "LambertCookTorrance[]"


mi.register_bsdf("lambert_cook_torrance", lambda props: LambertCookTorrance(props))


def mesh(arrays: Any, k: int, bsdf: dict[str, Any]) -> Any:
    """The k-th mesh of scene.npz."""
    props = mi.Properties()
    props["mesh_bsdf"] = mi.load_dict(bsdf)
    positions, faces = arrays[f"positions_{k}"], arrays[f"faces_{k}"]
    shape = mi.Mesh(f"mesh_{k}", len(positions), len(faces), has_vertex_normals=True, props=props)
    params = mi.traverse(shape)
    params["vertex_positions"], params["vertex_normals"] = positions.ravel(), arrays[f"normals_{k}"].ravel()
    params["faces"] = faces.ravel()
    params.update()
    return shape


def load(folder: Path, job: dict[str, Any]) -> Any:
    """The scene. Our cameras look along -Z with +X to the right, Mitsuba's along +Z with +X to the left; our maps have
    +X in their middle, Mitsuba's +Z."""
    arrays = np.load(folder / "scene.npz", allow_pickle=False)
    transform = mi.ScalarTransform4f
    sensor = {
        "type": "perspective",
        "fov": float(np.degrees(job["yfov"])),
        "fov_axis": "y",
        "to_world": transform((arrays["camera"] @ np.diag([-1.0, 1.0, -1.0, 1.0])).tolist()),
        "film": {
            "type": "hdrfilm", "width": job["size"][0], "height": job["size"][1],
            "rfilter": {"type": "box"}, "pixel_format": "rgb", "component_format": "float32",
        },
    }  # fmt: skip
    environment = {
        "type": "envmap",
        "bitmap": mi.Bitmap(arrays["environment"]),
        "to_world": transform().rotate([0, 1, 0], 90),
    }
    scene = {"type": "scene", "integrator": {"type": "direct"}, "sensor": sensor, "light": environment}
    for k, bsdf in enumerate(job["bsdfs"]):
        scene[f"shape_{k}"] = mesh(arrays, k, bsdf)
    return mi.load_dict(scene)


def render(scene: Any, spp: int, most: int, seed: int) -> Any:
    """A picture of `spp` samples a pixel, `most` at once."""
    total: Any = 0.0
    passes = max(1, spp // most)
    for k in range(passes):
        picture = mi.render(scene, spp=min(spp, most), seed=seed * 10_000 + k)
        total = total + np.array(picture)
    return total / passes


def steps(scene: Any, job: dict[str, Any], folder: Path) -> None:
    """Two pictures with different seeds at each count: their difference is √2 times the error of one."""
    render(scene, job["spp"][0], job["most"], 99)  # compiles
    found = []
    for spp in job["spp"]:
        if spp >= job["most"]:
            render(scene, job["most"], job["most"], 98)  # each wavefront size warms up by itself
        began = time.perf_counter()
        one, other = (render(scene, spp, job["most"], seed) for seed in (1, 2))
        taken_s = (time.perf_counter() - began) / 2
        picture = (one + other) / 2
        scale = np.sqrt(np.mean(picture[..., :3] ** 2))
        error = np.sqrt(np.mean((one - other) ** 2) / 2) / scale
        found.append({"spp": spp, "seconds": taken_s, "error": float(error)})
    np.save(folder / "picture.npy", np.ascontiguousarray(picture[..., :3], np.float32))
    (folder / "result.json").write_text(json.dumps({"steps": found, "version": mi.__version__}))


def passes(scene: Any, job: dict[str, Any], folder: Path) -> None:
    """Pictures that are independent of each other. (passes, height, width, 3)"""
    pictures = [render(scene, job["spp"][0], job["most"], seed)[..., :3] for seed in range(job["passes"])]
    np.save(folder / "passes.npy", np.array(pictures, np.float32))
    (folder / "result.json").write_text(json.dumps({"version": mi.__version__}))


def main(folder: Path) -> None:
    """One job."""
    job = json.loads((folder / "job.json").read_text())
    scene = load(folder, job)
    (passes if "passes" in job else steps)(scene, job, folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
