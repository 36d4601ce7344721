"""glTF's material as a BSDF for Mitsuba 3: the formulas of the specification's appendix B and of the extensions.

Imported by peer_mitsuba_files.py; independent of relume. Textures are multiplied by their factors when the arrays are
made, so that here everything is an image or one texel.
"""

from __future__ import annotations

from typing import Any

mi: Any = __import__("mitsuba")
dr: Any = __import__("drjit")

_LEAST_ALPHA = 1e-3
_LEAST_FACING = 0.01  # cosine between a normal and the direction to the viewer


class Texel(dict[str, Any]):
    """Values of a material's images at a point."""

    def __getattr__(self, name: str) -> Any:
        return self[name]


class _Gltf(mi.BSDF):  # type: ignore[misc]
    """Metallic-roughness with specular, anisotropy, clearcoat and sheen; reflection only, the same on both sides.

    The side is that of the geometry. A shading normal that faces away from the viewer is bent just into view: otherwise
    silhouettes of coarse meshes and the far sides of bumps would be black, although something is visible there.

    Properties: textures "base" (3), "rough" (1), "metal" (1), "weight" (1) and "tint" (3) of the specular lobe, "coat"
    (1), "coat_rough" (1), "sheen" (3), "normal" (3, unit, tangent space, halved and moved into [0, 1]); "colors",
    "tangent" and "hand" are attributes of the mesh; numbers "f0", "anisotropy", "turn", "sheen_alpha", and six
    "NAME_ij" for the UV transform of a texture.
    """

    def __init__(self, props: Any) -> None:
        mi.BSDF.__init__(self, props)
        property_names = [name for name in props.keys() if name != "id"]  # noqa: SIM118  (not a mapping)
        given = {name: props[name] for name in property_names}
        self.textures = {name: value for name, value in given.items() if isinstance(value, mi.Texture)}
        self.numbers = {name: float(value) for name, value in given.items() if isinstance(value, int | float)}
        sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        flags = mi.BSDFFlags.GlossyReflection | sides | mi.BSDFFlags.SpatiallyVarying
        self.m_components, self.m_flags = [flags], flags
        self.sheen_table = None
        if "sheen_alpha" in self.numbers:
            self.sheen_table = mi.Float(_sheen_albedo(self.numbers["sheen_alpha"]))

    def _texture(self, name: str, si: Any, active: Any, width: int) -> Any:
        texture = self.textures[name]
        placed = mi.SurfaceInteraction3f(si)
        if f"{name}_00" in self.numbers:
            m = [[self.numbers[f"{name}_{row}{column}"] for column in range(3)] for row in range(2)]
            u, v = si.uv.x, si.uv.y
            placed.uv = mi.Point2f(*(row[0] * u + row[1] * v + row[2] for row in m))
        return texture.eval_1(placed, active) if width == 1 else mi.Color3f(texture.eval_3(placed, active))

    def _at(self, si: Any, active: Any) -> Texel:
        texel = Texel()
        for name, width in {"base": 3, "rough": 1, "metal": 1, "weight": 1, "tint": 3}.items():
            texel[name] = self._texture(name, si, active, width)
        if "colors" in self.textures:
            texel["base"] *= mi.Color3f(self.textures["colors"].eval_3(si, active))
        for name, width in {"coat": 1, "coat_rough": 1, "sheen": 3}.items():
            if name in self.textures:
                texel[name] = self._texture(name, si, active, width)
        texel["frame"] = self._frame(si, active)
        alpha = texel.rough * texel.rough
        strength = self.numbers.get("anisotropy", 0.0)
        texel["across"] = dr.maximum(alpha, _LEAST_ALPHA)
        texel["along"] = dr.maximum(dr.lerp(alpha, 1.0, strength**2), _LEAST_ALPHA)
        return texel

    def _frame(self, si: Any, active: Any) -> Any:
        """Tangent, bitangent and normal after normal mapping, in coordinates of the shading frame."""
        if "tangent" in self.textures:
            along = mi.Vector3f(self.textures["tangent"].eval_3(si, active)) * 2 - 1
            handedness = self.textures["hand"].eval_1(si, active) * 2 - 1
        else:
            along, down = self._towards_texels(si)
            handedness = dr.sign(dr.dot(dr.cross(si.sh_frame.n, along), -down))
        along = si.to_local(along)
        up = mi.Vector3f(0, 0, dr.select(self._outward(si).z >= 0, mi.Float(1), mi.Float(-1)))
        along = dr.normalize(mi.Vector3f(along.x, along.y, 0) + mi.Vector3f(1e-9, 0, 0))
        bitangent = dr.cross(mi.Vector3f(0, 0, 1), along) * handedness
        normal = up
        if "normal" in self.textures:
            bump = mi.Vector3f(self._texture("normal", si, active, 3)) * 2 - 1
            normal = dr.normalize(bump.x * along + bump.y * bitangent + bump.z * up)
        deficit = dr.maximum(_LEAST_FACING - dr.dot(normal, si.wi), 0)
        normal = dr.normalize(normal + deficit * si.wi)
        rotation = self.numbers.get("turn", 0.0)
        s = along * dr.cos(rotation) + bitangent * dr.sin(rotation)
        s = dr.normalize(s - normal * dr.dot(normal, s))
        return mi.Frame3f(s, dr.cross(normal, s), normal)

    @staticmethod
    def _outward(si: Any) -> Any:
        """Normal of the face, on the viewer's side, in coordinates of the shading frame."""
        normal = si.to_local(si.n)
        return dr.select(dr.dot(normal, si.wi) >= 0, normal, -normal)

    def _towards_texels(self, si: Any) -> tuple[Any, Any]:
        """Directions of the normal map's u, and of its v, which points down."""
        if "normal_00" not in self.numbers:
            return si.dp_du, si.dp_dv
        (a, b), (c, d) = ([self.numbers[f"normal_{row}{column}"] for column in range(2)] for row in range(2))
        determinant = a * d - b * c
        return (d * si.dp_du - c * si.dp_dv) / determinant, (a * si.dp_dv - b * si.dp_du) / determinant

    def _value(self, t: Texel, wi: Any, wo: Any) -> Any:
        """BRDF times the cosine; directions in the mapped frame."""
        cos_o, cos_i = dr.maximum(wi.z, 1e-4), dr.maximum(wo.z, 1e-4)
        h = dr.normalize(wi + wo)
        cos_d = dr.abs(dr.dot(wi, h))
        facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, t.along, t.across, True)
        specular = facets.eval(h) * facets.G(wi, wo, h) / (4 * cos_i * cos_o)
        rise = (1 - cos_d) ** 5
        head_on = dr.minimum(self.numbers["f0"] * t.tint, 1)
        fresnel = head_on + (1 - head_on) * rise
        dielectric = (1 - t.weight * dr.max(fresnel)) * t.base / dr.pi + t.weight * fresnel * specular
        metal = specular * (t.base + (1 - t.base) * rise)
        value = dr.lerp(dielectric, metal, t.metal)
        if "sheen" in t:
            value = self._sheen(t, value, cos_i, cos_o, h.z)
        if "coat" in t:
            alpha = dr.maximum(t.coat_rough * t.coat_rough, _LEAST_ALPHA)
            film = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, alpha, True)
            over = film.eval(h) * film.G(wi, wo, h) / (4 * cos_i * cos_o)
            value = dr.lerp(value, mi.Color3f(over), t.coat * (0.04 + 0.96 * (1 - cos_o) ** 5))
        return value * cos_i

    def _sheen(self, t: Texel, below: Any, cos_i: Any, cos_o: Any, cos_h: Any) -> Any:
        alpha = self.numbers["sheen_alpha"]
        fibres = (2 + 1 / alpha) * dr.power(dr.maximum(1 - cos_h * cos_h, 1e-8), 0.5 / alpha) / (2 * dr.pi)
        masking = 1 / ((1 + _sheen_lambda(cos_i, alpha) + _sheen_lambda(cos_o, alpha)) * (4 * cos_i * cos_o))
        max_sheen = dr.max(t.sheen)
        base_scale = dr.minimum(1 - max_sheen * self._albedo(cos_i), 1 - max_sheen * self._albedo(cos_o))
        return t.sheen * fibres * masking + below * base_scale

    def _albedo(self, cosine: Any) -> Any:
        last = dr.width(self.sheen_table) - 1
        coordinate = dr.clip(cosine, 0, 1) * last
        low = dr.minimum(mi.UInt32(coordinate), last - 1)
        fraction = coordinate - mi.Float(low)
        low_value = dr.gather(mi.Float, self.sheen_table, low)
        return dr.lerp(low_value, dr.gather(mi.Float, self.sheen_table, low + 1), fraction)

    def _get_lobe_probabilities(self, t: Texel) -> tuple[Any, Any, Any]:
        """Sampling probabilities of the cosine, the facets, and the coat."""
        diffuse = 0.1 + 0.4 * (1 - t.metal)
        coat = 0.3 * t.coat if "coat" in t else mi.Float(0)
        return diffuse * (1 - coat), (1 - diffuse) * (1 - coat), coat

    def _density(self, t: Texel, wi: Any, wo: Any) -> Any:
        h = dr.normalize(wi + wo)
        jacobian = 1 / (4 * dr.maximum(dr.abs(dr.dot(wo, h)), 1e-6))
        diffuse, glossy, coat = self._get_lobe_probabilities(t)
        facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, t.along, t.across, True)
        density = diffuse * mi.warp.square_to_cosine_hemisphere_pdf(wo) + glossy * facets.pdf(wi, h) * jacobian
        if "coat" in t:
            alpha = dr.maximum(t.coat_rough * t.coat_rough, _LEAST_ALPHA)
            film = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, alpha, True)
            density += coat * film.pdf(wi, h) * jacobian
        return density

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        t = self._at(si, active)
        wi = t.frame.to_local(si.wi)
        diffuse, glossy, _ = self._get_lobe_probabilities(t)
        facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, t.along, t.across, True)
        h, _ = facets.sample(wi, sample2)
        if "coat" in t:
            alpha = dr.maximum(t.coat_rough * t.coat_rough, _LEAST_ALPHA)
            film, _ = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, alpha, True).sample(wi, sample2)
            h = dr.select(sample1 < diffuse + glossy, h, film)
        wo = dr.select(sample1 < diffuse, mi.warp.square_to_cosine_hemisphere(sample2), mi.reflect(wi, h))
        bs = mi.BSDFSample3f()
        bs.wo = t.frame.to_world(wo)
        bs.pdf = dr.select(self._is_same_side(si, wi, bs.wo, wo, active), self._density(t, wi, wo), 0)
        bs.eta, bs.sampled_component = 1.0, mi.UInt32(0)
        bs.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        usable = bs.pdf > 1e-9
        value = dr.select(usable, self._value(t, wi, wo) / dr.maximum(bs.pdf, 1e-9), 0)
        return bs, mi.Color3f(value) & active

    def _eval_and_pdf(self, si: Any, wo: Any, active: Any) -> tuple[Any, Any]:
        t = self._at(si, active)
        bent_i, bent_o = t.frame.to_local(si.wi), t.frame.to_local(wo)
        is_visible = self._is_same_side(si, bent_i, wo, bent_o, active)
        value = dr.select(is_visible, mi.Color3f(self._value(t, bent_i, bent_o)), 0)
        return value, dr.select(is_visible, self._density(t, bent_i, bent_o), 0)

    def _is_same_side(self, si: Any, bent_i: Any, wo: Any, bent_o: Any, active: Any) -> Any:
        return active & (dr.dot(self._outward(si), wo) > 0) & (bent_i.z > 0) & (bent_o.z > 0)

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        return self._eval_and_pdf(si, wo, active)[0]

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        return self._eval_and_pdf(si, wo, active)[1]

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
        """Mitsuba's interface."""
        return self._eval_and_pdf(si, wo, active)

    def to_string(self) -> str:
        """Mitsuba's interface."""
        return "Gltf[]"


mi.register_bsdf("gltf", _Gltf)


def _sheen_l(x: Any, alpha: float) -> Any:
    """Equation 3 of Estevez and Kulla 2017."""
    t = (1 - alpha) ** 2
    ends = ((25.3245, 3.32435, 0.16801, -1.27393, -4.85967), (21.5473, 3.82987, 0.19823, -1.97760, -4.32054))
    a, b, c, d, e = (t * smooth_value + (1 - t) * rough_value for smooth_value, rough_value in zip(*ends, strict=True))
    return a / (1 + b * dr.power(x, c)) + d * x + e


def _sheen_lambda(cosine: Any, alpha: float) -> Any:
    low = dr.exp(_sheen_l(cosine, alpha))
    high = dr.exp(2 * _sheen_l(mi.Float(0.5), alpha) - _sheen_l(dr.maximum(1 - cosine, 1e-6), alpha))
    return dr.select(cosine < 0.5, low, high)


def _sheen_albedo(alpha: float, num: int = 65) -> list[float]:
    """Albedo of a white sheen at evenly spaced cosines."""
    albedos = []
    for k in range(num):
        cos_o = max(k / (num - 1), 1e-3)
        i, j = dr.meshgrid(dr.arange(mi.Float, 256), dr.arange(mi.Float, 256))
        cos_i, phi = (i + 0.5) / 256, 2 * dr.pi * (j + 0.5) / 256
        sin_i, sin_o = dr.sqrt(1 - cos_i * cos_i), (1 - cos_o * cos_o) ** 0.5
        x, y, z = sin_i * dr.cos(phi) + sin_o, sin_i * dr.sin(phi), cos_i + cos_o
        cos_h2 = z * z / (x * x + y * y + z * z)
        fibres = (2 + 1 / alpha) * dr.power(dr.maximum(1 - cos_h2, 1e-8), 0.5 / alpha) / (2 * dr.pi)
        shadowed = 1 + _sheen_lambda(cos_i, alpha) + _sheen_lambda(mi.Float(cos_o), alpha)
        albedos.append(2 * dr.pi * dr.mean(fibres / (shadowed * 4 * cos_o))[0])
    return albedos
