/** Outgoing environment highlights of the probes: sums over the visible lights, as
 * `relume.live.free_camera.highlights.light_sum_kernel`. */
import type { FreeCameraBody } from "../../protocol";

/** Sum for unit albedo, without the environment's gain; also the confidence in the lobes, and in the sum on curved
 * normals. Needs the lobe visibility. */
export const highlightGlsl = ({ shapes: { elevation_rings, azimuths, widths, min_bits } }: FreeCameraBody) => `
uniform sampler2D uEnvironmentLights, uShapes;
const int SHAPE = ${1 + widths * elevation_rings * 2};
vec4 shapeTexel(int row, int texel, float fraction) {
  return mix(texelFetch(uShapes, at(row * SHAPE + texel), 0), texelFetch(uShapes, at((row + 1) * SHAPE + texel), 0), fraction);
}
float onRing(int row, float fraction, int ring, int azimuth, float blend) {
  int half2 = azimuth > 2 ? 1 : 0, offset = azimuth - 2 * half2;
  vec4 four = shapeTexel(row, 1 + 2 * ring + half2, fraction);
  vec2 two = offset == 0 ? four.xy : offset == 1 ? four.yz : four.zw;
  return mix(two.x, two.y, blend);
}
vec3 lightSum(int p, int row, float fraction, vec3 n, vec3 wo, float facing, out float confidence, out float curvedConfidence) {
  vec4 head = shapeTexel(row, 0, fraction);
  confidence = head.x;
  curvedConfidence = head.z;
  vec3 mirror = 2.0 * facing * n - wo, across = n - facing * mirror, sum = vec3(0.0);
  across *= inversesqrt(max(dot(across, across), 1e-12));
  for (int word = 0; word < 4 * uVisibilityTexels; word++) {
    uvec4 bits = texelFetch(uVisibleLights, at(p * uVisibilityTexels + (word >> 2)), 0);
    int component = word & 3;
    uint here = component == 0 ? bits.x : component == 1 ? bits.y : component == 2 ? bits.z : bits.w;
    for (int group = 8 * word; here != 0u; group++) {
      int light = 16 * group + int(here & 15u);
      here >>= 4u;
      if ((light & 15) == 0) continue;
      vec4 towards = texelFetch(uEnvironmentLights, at(2 * light), 0);
      float off = clamp(2.0 - 2.0 * dot(mirror, towards.xyz), intBitsToFloat(${min_bits}), 4.0);
      float turn = arcCosine(clamp(dot(across, towards.xyz) * inversesqrt(max(off * (1.0 - 0.25 * off), 1e-12)), -1.0, 1.0));
      float ring = min(float(floatBitsToInt(off) - ${min_bits}) * ${(2 ** -22).toExponential()}, ${(elevation_rings - 1.001).toFixed(3)});
      float azimuth = clamp(turn * ${azimuths.toFixed(1)} / PI - 0.5, 0.0, ${(azimuths - 1.001).toFixed(3)});
      int r = int(ring), s = int(azimuth), first = int(towards.w) * ${elevation_rings} + r;
      float value = mix(onRing(row, fraction, first, s, azimuth - float(s)), onRing(row, fraction, first + 1, s, azimuth - float(s)), ring - float(r));
      vec3 both = towards.xyz + wo;
      float below = max(2.0 - 2.0 * (dot(n, towards.xyz) + facing) * inversesqrt(max(dot(both, both), 1e-6)), 0.0) + head.y;
      sum += value / (below * below) * texelFetch(uEnvironmentLights, at(2 * light + 1), 0).rgb;
    }
  }
  return sum;
}
`;
