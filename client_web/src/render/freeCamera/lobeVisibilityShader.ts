/** Lobe visibility of the probes: one bit per environment light, as `relume.live.free_camera.highlights.lobe_visibility`. */
import type { FreeCameraBody } from "../../protocol";

/** The visible fraction of the environment's light in a lobe, and of two bright lights. */
export const lobeVisibilityGlsl = ({ lobe_lists: { bins_per_side, max_listed, lights_per_bright_light: lightsPerBrightLight, min_width, widths } }: FreeCameraBody) => `
uniform usampler2D uSeenLights;
uniform isampler2D uLobeLists, uLobeFirsts;
uniform sampler2D uLobeLights, uLightsOfLamps;
uniform int uSeenTexels;
bool isSeen(int p, int light) {
  uvec4 bits = texelFetch(uSeenLights, at(p * uSeenTexels + (light >> 7)), 0);
  int word = (light >> 5) & 3;
  uint here = word == 0 ? bits.x : word == 1 ? bits.y : word == 2 ? bits.z : bits.w;
  return ((here >> uint(light & 31)) & 1u) != 0u;
}
int squareOf(vec3 d) {
  d /= abs(d.x) + abs(d.y) + abs(d.z);
  vec2 place = d.xz;
  if (d.y < 0.0) place = (1.0 - abs(d.zx)) * vec2(d.x < 0.0 ? -1.0 : 1.0, d.z < 0.0 ? -1.0 : 1.0);
  ivec2 square = clamp(ivec2((place + 1.0) * ${(bins_per_side / 2).toFixed(1)}), 0, ${bins_per_side - 1});
  return square.y * ${bins_per_side} + square.x;
}
float lampSeen(int lamp, int p) {
  float seen = 0.0;
  for (int k = 0; k < ${lightsPerBrightLight}; k++) {
    vec2 one = texelFetch(uLightsOfLamps, at(lamp * ${lightsPerBrightLight} + k), 0).xy;
    if (one.x < 0.0) break;
    if (isSeen(p, int(one.x))) seen += one.y;
  }
  return seen;
}
vec3 glanceAlong(Lobes lobes, int p) {
  vec3 middle = mix(lobes.other, lobes.one, lobes.first);
  float size = length(middle), own = mix(lobes.sigma2 * lobes.sigma2, lobes.sigma * lobes.sigma, lobes.first);
  float variance = own + max(1.0 - size, 0.0);
  middle /= size;
  int width = clamp(int(floor(2.0 * log2(max(sqrt(variance), 1e-6) / ${min_width}) + 0.5)), 0, ${widths - 1});
  int list = texelFetch(uLobeFirsts, at(width), 0).x + squareOf(middle);
  float seen = 0.0, total = 1e-30;
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
      if (weight > 0.0 && isSeen(p, light)) seen += weight;
    }
    if (four.w < 0) break;
  }
  return vec3(seen / total, uNumLamps > 0 ? lampSeen(0, p) : 0.0, uNumLamps > 1 ? lampSeen(1, p) : 0.0);
}
`;
