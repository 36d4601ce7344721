/** Lobe visibility of the probes: one bit per environment light, as `relume.live.free_camera.highlights.lobe_visibility`. */
import type { FreeCameraBody } from "../../protocol";

/** Visible fraction of the environment's light in a lobe, and of two bright lights. */
export const lobeVisibilityGlsl = ({
  lobe_lists: { bins_per_side, max_listed, lights_per_bright_light: lightsPerBrightLight, min_width, widths },
}: FreeCameraBody) => `
uniform usampler2D uVisibleLights;
uniform isampler2D uLobeLists, uLobeFirsts;
uniform sampler2D uLobeLights, uBrightLightMembers;
uniform int uVisibilityTexels;
bool isVisible(int p, int light) {
  uvec4 bits = texelFetch(uVisibleLights, at(p * uVisibilityTexels + (light >> 7)), 0);
  int word = (light >> 5) & 3;
  uint here = word == 0 ? bits.x : word == 1 ? bits.y : word == 2 ? bits.z : bits.w;
  return ((here >> uint(light & 31)) & 1u) != 0u;
}
int binOf(vec3 d) {
  d /= abs(d.x) + abs(d.y) + abs(d.z);
  vec2 octahedral = d.xz;
  if (d.y < 0.0) octahedral = (1.0 - abs(d.zx)) * vec2(d.x < 0.0 ? -1.0 : 1.0, d.z < 0.0 ? -1.0 : 1.0);
  ivec2 bin = clamp(ivec2((octahedral + 1.0) * ${(bins_per_side / 2).toFixed(1)}), 0, ${bins_per_side - 1});
  return bin.y * ${bins_per_side} + bin.x;
}
float brightLightVisibility(int brightLight, int p) {
  float visible = 0.0;
  for (int k = 0; k < ${lightsPerBrightLight}; k++) {
    vec2 member = texelFetch(uBrightLightMembers, at(brightLight * ${lightsPerBrightLight} + k), 0).xy;
    if (member.x < 0.0) break;
    if (isVisible(p, int(member.x))) visible += member.y;
  }
  return visible;
}
vec3 lobeVisibilityOf(Lobes lobes, int p) {
  vec3 middle = mix(lobes.second, lobes.first, lobes.firstWeight);
  float size = length(middle), own = mix(lobes.sigma2 * lobes.sigma2, lobes.sigma * lobes.sigma, lobes.firstWeight);
  float variance = own + max(1.0 - size, 0.0);
  middle /= size;
  int width = clamp(int(floor(2.0 * log2(max(sqrt(variance), 1e-6) / ${min_width}) + 0.5)), 0, ${widths - 1});
  int list = texelFetch(uLobeFirsts, at(width), 0).x + binOf(middle);
  float visible = 0.0, total = 1e-30;
  for (int q = 0; q < ${max_listed / 4}; q++) {
    ivec4 four = texelFetch(uLobeLists, at(list * ${max_listed / 4} + q), 0);
    for (int k = 0; k < 4; k++) {
      int light = k == 0 ? four.x : k == 1 ? four.y : k == 2 ? four.z : four.w;
      if (light < 0) break;
      vec4 towards = texelFetch(uLobeLights, at(2 * light), 0);
      float per = 1.0 / (variance + towards.w), left = max(1.0 - (1.0 - dot(middle, towards.xyz)) * per * 0.125, 0.0);
      left *= left;
      left *= left;
      float weight = texelFetch(uLobeLights, at(2 * light + 1), 0).x * per * left * left;
      total += weight;
      if (weight > 0.0 && isVisible(p, light)) visible += weight;
    }
    if (four.w < 0) break;
  }
  return vec3(visible / total, uNumBrightLights > 0 ? brightLightVisibility(0, p) : 0.0, uNumBrightLights > 1 ? brightLightVisibility(1, p) : 0.0);
}
`;
