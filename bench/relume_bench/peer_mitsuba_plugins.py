"""BSDFs and an integrator for Mitsuba 3, imported by peer_mitsuba_render.py."""

from __future__ import annotations

from typing import Any

mi: Any = __import__("mitsuba")
dr: Any = __import__("drjit")


class _Sided(mi.BSDF):  # type: ignore[misc]
    """One-sided BSDF with components of these flags. A subclass has `sample`, `eval` and `pdf`."""

    def __init__(self, props: Any, *flags: Any) -> None:
        mi.BSDF.__init__(self, props)
        self.m_components = [flag | mi.BSDFFlags.FrontSide for flag in flags]
        self.m_flags = self.m_components[0] | self.m_components[1]

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def to_string(self) -> str:
        """Mitsuba's interface."""
        return f"{type(self).__name__}[]"


class _TwoLobes(_Sided):
    """A diffuse and a glossy lobe, with properties "albedo", a color or a texture, and "gain".

    A subclass has, with `wo` toward the light in Mitsuba's convention, `_glossy(wi, wo)`, the glossy BRDF times the
    cosine; `_sample_direction(wi, lobe_sample, direction_sample)`, a direction from numbers in [0, 1), and
    `_density(wi, wo)`, its density, 1/sr.
    """

    def __init__(self, props: Any) -> None:
        super().__init__(props, mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection)
        albedo = props["albedo"]
        self.albedo = albedo if isinstance(albedo, mi.Texture) else mi.Color3f(albedo)
        self.gain = mi.Color3f(props["gain"])

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        bs = mi.BSDFSample3f()
        bs.wo = self._sample_direction(si.wi, sample1, sample2)
        bs.pdf = self.pdf(ctx, si, bs.wo, active)
        bs.eta, bs.sampled_component = 1.0, mi.UInt32(0)
        bs.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        usable = active & (bs.pdf > 0)
        return bs, dr.select(usable, self.eval(ctx, si, bs.wo, usable) / dr.maximum(bs.pdf, 1e-12), 0)

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        is_texture = isinstance(self.albedo, mi.Texture)
        albedo = mi.Color3f(self.albedo.eval_3(si, active)) if is_texture else self.albedo
        value = albedo / dr.pi * mi.Frame3f.cos_theta(wo) + self.gain * self._glossy(si.wi, wo)
        return dr.select(_above(si.wi, wo, active), mi.Color3f(value), 0)

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        return dr.select(_above(si.wi, wo, active), self._density(si.wi, wo), 0)


def _above(wi: Any, wo: Any, active: Any) -> Any:
    return active & (mi.Frame3f.cos_theta(wi) > 0) & (mi.Frame3f.cos_theta(wo) > 0)


class LambertCookTorrance(_TwoLobes):
    """albedo/π + D F G / (4π cos θi cos θo), Beckmann facets, dielectric Fresnel, V-cavity masking.

    Samples the cosine and the facets with equal probability.
    """

    def __init__(self, props: Any) -> None:
        super().__init__(props)
        self.sigma, self.ior = float(props["sigma"]), float(props["ior"])

    def _facets(self) -> Any:
        return mi.MicrofacetDistribution(mi.MicrofacetType.Beckmann, self.sigma, sample_visible=False)

    def _glossy(self, wi: Any, wo: Any) -> Any:
        h = dr.normalize(wi + wo)
        cos_h, cos_d = mi.Frame3f.cos_theta(h), dr.maximum(dr.dot(h, wi), 1e-6)
        cos_o, cos_i = mi.Frame3f.cos_theta(wi), mi.Frame3f.cos_theta(wo)
        cos2 = cos_h * cos_h
        facets = dr.exp(-(1 - cos2) / (cos2 * self.sigma**2)) / (self.sigma**2 * cos2 * cos2)
        masking = dr.minimum(1, 2 * cos_h * dr.minimum(cos_i, cos_o) / cos_d)
        fresnel = mi.fresnel(cos_d, self.ior)[0]
        return facets * fresnel * masking / (4 * dr.pi * cos_o)

    def _density(self, wi: Any, wo: Any) -> Any:
        h = dr.normalize(wi + wo)
        facets = self._facets().pdf(wi, h) / (4 * dr.maximum(dr.dot(wo, h), 1e-6))
        return 0.5 * (mi.warp.square_to_cosine_hemisphere_pdf(wo) + facets)

    def _sample_direction(self, wi: Any, lobe_sample: Any, direction_sample: Any) -> Any:
        h, _ = self._facets().sample(wi, direction_sample)
        return dr.select(lobe_sample < 0.5, mi.warp.square_to_cosine_hemisphere(direction_sample), mi.reflect(wi, h))


mi.register_bsdf("lambert_cook_torrance", lambda props: LambertCookTorrance(props))


class LambertBlinnPhong(_TwoLobes):
    """albedo/π + gain (s + 2)/(2π) cos^s θh; samples the two by their mean albedos."""

    def __init__(self, props: Any) -> None:
        super().__init__(props)
        self.exponent, self.diffuse = float(props["exponent"]), float(props["diffuse_share"])

    def _glossy(self, wi: Any, wo: Any) -> Any:
        cos_i, cos_h = mi.Frame3f.cos_theta(wo), mi.Frame3f.cos_theta(dr.normalize(wi + wo))
        return cos_i * (self.exponent + 2) / (2 * dr.pi) * dr.power(dr.maximum(cos_h, 0), self.exponent)

    def _density(self, wi: Any, wo: Any) -> Any:
        h = dr.normalize(wi + wo)
        lobe = (self.exponent + 1) / (2 * dr.pi) * dr.power(dr.maximum(mi.Frame3f.cos_theta(h), 0), self.exponent)
        half_vector_pdf = lobe / (4 * dr.maximum(dr.dot(wo, h), 1e-6))
        return dr.lerp(half_vector_pdf, mi.warp.square_to_cosine_hemisphere_pdf(wo), self.diffuse)

    def _sample_direction(self, wi: Any, lobe_sample: Any, direction_sample: Any) -> Any:
        cos_h = dr.power(direction_sample.x, 1 / (self.exponent + 1))
        sin_h, phi = dr.safe_sqrt(1 - cos_h * cos_h), 2 * dr.pi * direction_sample.y
        h = mi.Vector3f(sin_h * dr.cos(phi), sin_h * dr.sin(phi), cos_h)
        return dr.select(
            lobe_sample < self.diffuse, mi.warp.square_to_cosine_hemisphere(direction_sample), mi.reflect(wi, h)
        )


mi.register_bsdf("lambert_blinn_phong", lambda props: LambertBlinnPhong(props))


class OrenNayar(_TwoLobes):
    """gain times the full model of Oren and Nayar 1994; samples the cosine."""

    def __init__(self, props: Any) -> None:
        super().__init__(props)
        self.sigma, self.facet_albedo = float(props["sigma"]), float(props["facet_albedo"])

    def _glossy(self, wi: Any, wo: Any) -> Any:
        cos_i, cos_o = mi.Frame3f.cos_theta(wi), mi.Frame3f.cos_theta(wo)
        alpha, beta = dr.safe_acos(dr.minimum(cos_i, cos_o)), dr.safe_acos(dr.maximum(cos_i, cos_o))
        sines = dr.maximum(mi.Frame3f.sin_theta(wi) * mi.Frame3f.sin_theta(wo), 1e-9)
        cos_phi = dr.clip((wi.x * wo.x + wi.y * wo.y) / sines, -1, 1)
        variance, low = self.sigma**2, 2 / dr.pi * beta
        roughness = variance / (variance + 0.09)
        c1, c3 = 1 - 0.5 * variance / (variance + 0.33), 0.125 * roughness * (2 / dr.pi * alpha * low) ** 2
        c2 = 0.45 * roughness * (dr.sin(alpha) - dr.select(cos_phi < 0, low**3, 0))
        once = c1 + cos_phi * c2 * dr.tan(beta) + c3 * (1 - dr.abs(cos_phi)) * dr.tan(0.5 * (alpha + beta))
        twice = self.facet_albedo * 0.17 * variance / (variance + 0.13) * (1 - cos_phi * low**2)
        return cos_o * dr.maximum(once + twice, 0) / dr.pi

    def _density(self, wi: Any, wo: Any) -> Any:
        return mi.warp.square_to_cosine_hemisphere_pdf(wo)

    def _sample_direction(self, wi: Any, lobe_sample: Any, direction_sample: Any) -> Any:
        return mi.warp.square_to_cosine_hemisphere(direction_sample)


mi.register_bsdf("oren_nayar", lambda props: OrenNayar(props))


class LambertGgx(_TwoLobes):
    """albedo/π + gain D F G1(wi) G1(wo) / (4 cos θi cos θo): GGX facets, Schlick's reflectance from f0.

    Samples visible facets; the cosine with the probability `diffuse_share`.
    """

    def __init__(self, props: Any) -> None:
        super().__init__(props)
        self.f0, self.alpha = mi.Color3f(props["f0"]), float(props["roughness"]) ** 2
        self.diffuse = float(props["diffuse_share"])

    def _facets(self) -> Any:
        return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha, sample_visible=True)

    def _glossy(self, wi: Any, wo: Any) -> Any:
        h, facets = dr.normalize(wi + wo), self._facets()
        fresnel = self.f0 + (1 - self.f0) * (1 - dr.maximum(dr.dot(h, wi), 0)) ** 5
        return facets.eval(h) * facets.G(wi, wo, h) * fresnel / (4 * mi.Frame3f.cos_theta(wi))

    def _density(self, wi: Any, wo: Any) -> Any:
        h = dr.normalize(wi + wo)
        facets = self._facets().pdf(wi, h) / (4 * dr.maximum(dr.dot(wo, h), 1e-6))
        return dr.lerp(facets, mi.warp.square_to_cosine_hemisphere_pdf(wo), self.diffuse)

    def _sample_direction(self, wi: Any, lobe_sample: Any, direction_sample: Any) -> Any:
        h, _ = self._facets().sample(wi, direction_sample)
        cosine = mi.warp.square_to_cosine_hemisphere(direction_sample)
        return dr.select(lobe_sample < self.diffuse, cosine, mi.reflect(wi, h))


mi.register_bsdf("lambert_ggx", lambda props: LambertGgx(props))


class Ward(_TwoLobes):
    """gain exp(−tan² θh (cos² φh / αx² + sin² φh / αy²)) / (4π αx αy √(cos θi cos θo)), Ward 1992; samples facets."""

    def __init__(self, props: Any) -> None:
        props["albedo"] = mi.ScalarColor3f(0)
        super().__init__(props)
        alphas = float(props["alpha_x"]), float(props["alpha_y"])
        self.facets = mi.MicrofacetDistribution(mi.MicrofacetType.Beckmann, *alphas, sample_visible=False)

    def _glossy(self, wi: Any, wo: Any) -> Any:
        h = dr.normalize(wi + wo)
        cosines = dr.maximum(mi.Frame3f.cos_theta(wi) * mi.Frame3f.cos_theta(wo), 1e-12)
        slopes = self.facets.eval(h) * mi.Frame3f.cos_theta(h) ** 4
        return slopes * mi.Frame3f.cos_theta(wo) / (4 * dr.sqrt(cosines))

    def _density(self, wi: Any, wo: Any) -> Any:
        h = dr.normalize(wi + wo)
        return self.facets.pdf(wi, h) / (4 * dr.maximum(dr.dot(wo, h), 1e-6))

    def _sample_direction(self, wi: Any, lobe_sample: Any, direction_sample: Any) -> Any:
        return mi.reflect(wi, self.facets.sample(wi, direction_sample)[0])


mi.register_bsdf("ward", lambda props: Ward(props))


class _MirrorOverDiffuse(_Sided):
    """A smooth mirror mixed with albedo/π, by `diffuse_probability`.

    Mitsuba's own `blendbsdf` of the two loses energy: under a constant environment of 1, a mixture with a tenth of a
    mirror and an albedo of 0.3 reflects 0.363 (3.9.1), because the sampling densities lack the weights.
    """

    def __init__(self, props: Any) -> None:
        super().__init__(props, mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.DeltaReflection)
        self.albedo, self.diffuse_probability = mi.Color3f(props["albedo"]), float(props["share"])

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        bs, is_mirror = mi.BSDFSample3f(), sample1 < self.diffuse_probability
        bs.wo = dr.select(is_mirror, mi.reflect(si.wi), mi.warp.square_to_cosine_hemisphere(sample2))
        bs.pdf = dr.select(is_mirror, self.diffuse_probability, self.pdf(ctx, si, bs.wo, active))
        bs.eta, bs.sampled_component = 1.0, dr.select(is_mirror, mi.UInt32(1), mi.UInt32(0))
        types = (mi.UInt32(+mi.BSDFFlags.DeltaReflection), mi.UInt32(+mi.BSDFFlags.DiffuseReflection))
        bs.sampled_type = dr.select(is_mirror, *types)
        weight = dr.select(is_mirror, mi.Color3f(1), self.albedo / (1 - self.diffuse_probability))
        return bs, dr.select(_above(si.wi, bs.wo, active), weight, 0)

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        return dr.select(_above(si.wi, wo, active), self.albedo / dr.pi * mi.Frame3f.cos_theta(wo), 0)

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        density = (1 - self.diffuse_probability) * mi.warp.square_to_cosine_hemisphere_pdf(wo)
        return dr.select(_above(si.wi, wo, active), density, 0)


mi.register_bsdf("mirror_over_diffuse", lambda props: _MirrorOverDiffuse(props))


class Indirect(mi.SamplingIntegrator):  # type: ignore[misc]
    """Indirect light at the first hit of the camera: one step, then Mitsuba's own path tracer.

    `camera_bsdfs` is the scene for camera rays; after the first hit paths continue in the rendered scene, which may
    have other BSDFs. Paths that leave the scene right after the first hit are direct light, and excluded.
    """

    def __init__(self, camera_bsdfs: Any, bounces: int) -> None:
        mi.SamplingIntegrator.__init__(self, mi.Properties())
        self.camera_bsdfs = camera_bsdfs
        path = {"type": "path", "max_depth": bounces + 1, "rr_depth": 6, "hide_emitters": True}
        self.path = mi.load_dict(path)

    def sample(
        self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True
    ) -> tuple[Any, Any, list[Any]]:
        """Mitsuba's interface.

        Args:
            scene: for the rest of the path. sampler: sampler of random numbers.
            ray: from the camera. medium: always None, there are none.
            active: active lanes.
        Returns:
            Radiance, lanes with a hit, and no further values.
        """
        si = self.camera_bsdfs.ray_intersect(ray, active)
        active = active & si.is_valid()
        bs, weight = si.bsdf(ray).sample(mi.BSDFContext(), si, sampler.next_1d(active), sampler.next_2d(active), active)
        active = active & (bs.pdf > 0)
        radiance, _, _ = self.path.sample(scene, sampler, si.spawn_ray(si.to_world(bs.wo)), None, active)
        return dr.select(active, weight * radiance, 0), active, []

    def to_string(self) -> str:
        """Mitsuba's interface."""
        return "Indirect[]"
