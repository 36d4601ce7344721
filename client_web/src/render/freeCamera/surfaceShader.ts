/** Surfaces as a camera sees them: the places of `relume.live.free_camera.primary_visibility`, the sum of `relume.live.free_camera.shade_pixels`, catchers of
 * `relume.live.free_camera.background`. Triangles are drawn as they are; the radiance of lattice nodes is interpolated in each pixel. */
import type { FreeCameraBody } from "../../protocol";
import { albedoGlsl, backgroundGlsl, NUM_GROUPS, SHADER_HEADER, LOBES_GLSL, luminanceGlsl, MATERIAL_TEXELS, EQUIRECTANGULAR_GLSL, elevationRowGlsl, ENVIRONMENT_GLSL } from "./dataLayout";
import type { MaterialFeatures } from "./materials";

/** Features of an image: only these are compiled. */
export interface ImageFeatures {
  /** What lies behind is a map. */
  map: boolean;
  /** How much a pixel hides is asked for. */
  coverage: boolean;
  /** One sample a pixel, written as RGB9_E5. */
  direct: boolean;
}
export type SurfaceFeatures = MaterialFeatures & ImageFeatures;

/** Whether pixels ask where they are, beside what is sent there. */
const needsWholeSurface = ({ lobes, textures, catchesShadows }: MaterialFeatures) => lobes || textures || catchesShadows;

/** What pixels of a triangle have in common: slots or the first of them, and the number of rows; what it emits; where
 * more is asked, its corners and material, its normal and scale of textures, its lobe and normal map. */
const flatVaryings = (shows: MaterialFeatures) => `
flat in uvec4 vSide;
flat in vec3 vEmission;
${needsWholeSurface(shows) ? "flat in uvec4 vCorners; flat in vec4 vFacing; flat in ivec2 vKind;" : ""}`;

/** No attributes: the number of a corner says all. \`uRotation\` has the camera's axes as its columns. */
export const cornerShader = (shows: MaterialFeatures) => `${SHADER_HEADER}
uniform usampler2D uCorners, uSides;
uniform sampler2D uPositions, uFacing;
uniform isampler2D uMaterials;
uniform vec3 uEye;
uniform mat3 uRotation;
uniform vec4 uFrustum;
${flatVaryings(shows).replaceAll("in ", "out ")}
centroid out vec2 vBary;
${needsWholeSurface(shows) ? "centroid out vec3 vAway;" : "vec3 vAway;"}
void main() {
  int number = gl_VertexID / 3, corner = gl_VertexID % 3;
  ivec2 face = at(number);
  uvec4 corners = texelFetch(uCorners, face, 0);
  vec4 facing = texelFetch(uFacing, face, 0);
  int material = int(corners.w) * ${MATERIAL_TEXELS};
  int position = int(corner == 0 ? corners.x : corner == 1 ? corners.y : corners.z);
  vAway = texelFetch(uPositions, at(position), 0).xyz - uEye;
  vBary = vec2(corner == 1, corner == 2);
  vSide = texelFetch(uSides, at(2 * number + int(dot(facing.xyz, vAway) > 0.0)), 0);
  vEmission = intBitsToFloat(texelFetch(uMaterials, at(material + ${NUM_GROUPS + 1}), 0)).rgb;
  ${needsWholeSurface(shows) ? `vCorners = corners; vFacing = facing; vKind = texelFetch(uMaterials, at(material + ${NUM_GROUPS}), 0).xy;` : ""}
  vec3 seen = vAway * uRotation;
  gl_Position = vec4(seen.xy * uFrustum.xy, uFrustum.z * seen.z + uFrustum.w, -seen.z);
}
`;

/** Pixels as RGB9_E5, and the coverage of each for display values (sRGB), as in other frames. */
const encodeGlsl = (hasAlpha: boolean) => `
layout(location = 0) out vec4 outWord;
${hasAlpha ? "layout(location = 1) out vec4 outHides;" : ""}
float powerOfTwo(int power) { return intBitsToFloat((power + 127) << 23); }
float encoded(float x) { return x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1.0 / 2.4) - 0.055; }
void finish(vec4 pixel) {
  vec3 color = clamp(pixel.rgb, 0.0, 65408.0);
  float largest = max(max(color.r, color.g), color.b);
  int exponent = max(-16, int((floatBitsToUint(largest) >> 23) & 255u) - 127) + 16;
  float scale = powerOfTwo(24 - exponent);
  bool isNext = floor(largest * scale + 0.5) == 512.0;
  uvec3 m = uvec3(color * (isNext ? 0.5 * scale : scale) + 0.5);
  uint word = m.r | (m.g << 9) | (m.b << 18) | (uint(exponent + int(isNext)) << 27);
  outWord = vec4(uvec4(word, word >> 8, word >> 16, word >> 24) & 255u) / 255.0;
  ${hasAlpha ? "outHides = vec4(1.0 - encoded(1.0 - min(pixel.a, 1.0)));" : ""}
}
`;
/** Linear radiance, of which a pixel takes the mean of its samples. */
const SAMPLES = `
out vec4 outColor;
void finish(vec4 pixel) { outColor = vec4(min(pixel.rgb, 65000.0), pixel.a); }
`;
const finishGlsl = ({ direct, coverage }: ImageFeatures) => (direct ? encodeGlsl(coverage) : SAMPLES);

/** Trilinear, as \`relume.live.free_camera.probes.texture_kernels\`. */
const TEXTURES = `
uniform sampler2D uTexels, uUvs;
uniform usampler2D uLevels;
int fold(uint wrap, int index, int size) {
  if (wrap == 2u) return clamp(index, 0, size - 1);
  int period = wrap == 0u ? size : 2 * size;
  int folded = index - period * int(floor(float(index) / float(period)));
  return wrap == 0u ? folded : min(folded, 2 * size - 1 - folded);
}
vec3 textureLevel(uvec4 texture, int level, vec2 place) {
  ivec3 size = ivec3(texelFetch(uLevels, at(int(texture.x) + level), 0).xyz);
  if (texture.z == 0u) place.x = fract(place.x);
  if (texture.w == 0u) place.y = fract(place.y);
  vec2 where = place * vec2(size.z, size.y) - 0.5, below = floor(where), share = where - below;
  int left = fold(texture.z, int(below.x), size.z), right = fold(texture.z, int(below.x) + 1, size.z);
  int upper = size.x + size.z * fold(texture.w, int(below.y), size.y);
  int lower = size.x + size.z * fold(texture.w, int(below.y) + 1, size.y);
  vec3 top = mix(texelFetch(uTexels, at(upper + left), 0).rgb, texelFetch(uTexels, at(upper + right), 0).rgb, share.x);
  return mix(top, mix(texelFetch(uTexels, at(lower + left), 0).rgb, texelFetch(uTexels, at(lower + right), 0).rgb, share.x), share.y);
}
vec3 textureAt(int number, vec2 place, float footprint) {
  uvec4 texture = texelFetch(uLevels, at(number), 0);
  uvec2 finest = texelFetch(uLevels, at(int(texture.x)), 0).yz;
  float level = min(log2(max(footprint * float(max(finest.x, finest.y)), 1.0)), float(texture.y) - 1.0);
  int lower = int(level);
  float share = level - float(lower);
  vec3 found = textureLevel(texture, lower, place);
  return share > 0.0 ? mix(found, textureLevel(texture, lower + 1, place), share) : found;
}
`;

/** A normal map's perturbation, and the change of broad lobes by it; as \`relume.live.free_camera.normal_mapping\`. */
const NORMAL_MAP_GLSL = `
vec3 leaning(int map, vec2 place, float footprint, vec3 n, vec4 tangent, vec3 outward) {
  vec3 found = textureAt(map, place, footprint);
  vec3 t = tangent.xyz - dot(tangent.xyz, n) * n;
  t *= inversesqrt(max(dot(t, t), 1e-12));
  vec3 b = cross(n, t);
  float side = tangent.w < 0.0 ? -1.0 : 1.0;
  vec3 leant = found.x * t + side * found.y * b + found.z * n;
  leant *= inversesqrt(max(dot(leant, leant), 1e-12));
  return dot(leant, outward) <= 0.0 ? n : leant;
}
`;

/** No loops: software rasterizers index vectors through memory. */
const blendGlsl = (value: (k: string) => string) => ["x", "y", "z"].map((k) => `weights.${k} * ${value(k)}`).join(" + ");
const fetchGlsl = (name: string, layer: number) =>
  `vec4 ${name} = ${blendGlsl((k) => `texelFetch(uValues, ivec3(at(slots.${k}), ${layer}), 0)`)};`;

/** Adds what a lobe sees, and what turning it changes of what is shown, `more` for an albedo of one. */
const OF_LOBE = (albedo: string) => `vec3 albedo = ${albedo}, shown = light * albedo;
      total = max(max(total, -0.5 * shown) + shown, 0.0);
      float whole = dot(${luminanceGlsl}, total);
      total *= 1.0 + clamp(more * dot(${luminanceGlsl}, albedo), -0.125 * whole, 0.125 * whole) / max(whole, 1e-20);`;

/** Adds the outgoing radiance of a group of terms. */
function groupGlsl(number: number, quantity: string, { lobes, textures }: MaterialFeatures, rows: number): string {
  if (!lobes && !textures) return `color += max(${quantity}, 0.0);`;
  const albedo = albedoGlsl(`(vKind.x * ${rows} + row) * ${NUM_GROUPS + 1} + ${number}`);
  return `{
    ivec4 of = texelFetch(uMaterials, at(material + ${number}), 0);
    if (of.z > 0) {
      vec3 total = ratio * ${quantity};
      ${lobes ? `${OF_LOBE(albedo)}` : ""}
      ${textures ? "if (of.w >= 0) total *= textureAt(of.w, place, footprint);" : ""}
      color += max(total, 0.0);
    }
  }`;
}

const SHADOW_CATCHER_GLSL = `bvec3 isLit;
  vec3 arrives = uGain * unhidden(slots, weights, isLit);
  vec3 shown = vec3(uFree);
  for (int channel = 0; channel < 3; channel++) {
    if (isLit[channel] && uGain[channel] > 0.0) shown[channel] = min(color[channel] / arrives[channel], 8.0);
  }
  color = shown * behind(d);
  hides -= dot(${luminanceGlsl}, min(shown, 1.0));`;

/** What catchers would receive if nothing were in the way. */
const UNOCCLUDED_GLSL = `
uniform usampler2D uPoints;
uniform sampler2D uWeights, uUnhidden;
uniform float uFree;
vec3 unhidden(ivec3 slots, vec3 weights, out bvec3 isLit) {
  vec3 sum = vec3(0.0);
  isLit = bvec3(true);
  for (int k = 0; k < 3; k++) {
    uvec4 points = texelFetch(uPoints, at(slots[k]), 0);
    vec4 shares = texelFetch(uWeights, at(slots[k]), 0);
    vec3 here = vec3(0.0);
    for (int q = 0; q < 4; q++) if (shares[q] > 0.0) here += shares[q] * texelFetch(uUnhidden, at(int(points[q])), 0).rgb;
    sum += weights[k] * here;
    isLit = bvec3(isLit.x && here.x > 0.0, isLit.y && here.y > 0.0, isLit.z && here.z > 0.0);
  }
  return sum;
}
`;

/** The light that a lobe sees, and where its albedo lies in tables. */
const mirrorGlsl = (rows: number) => `
float shareAbove(float x) { return 1.0 / (1.0 + exp(-1.702 * max(x, -20.0))); }
vec3 mirrored(int lobe, vec3 n, vec3 d, vec3 outward, vec4 glance, out int row, out float share) {
  row = rowOf(clamp(-dot(n, d), 0.01, 1.0), share);
  int of = (lobe * ${rows} + row) * ${NUM_GROUPS + 1} + ${NUM_GROUPS};
  Lobes lobes = alongBoth(of, share, n, d);
  vec3 ray = middleOf(lobes);
  float along = dot(d, outward), wide = wideOf(of, share);
  float away = dot(ray, outward) * (along > 0.0 ? -1.0 : 1.0);
  float above = min(shareAbove(away / wide) / shareAbove(abs(along) / wide), 1.0);
  return above * skyInBoth(lobes, glance.xyz);
}
`;

/** A pixel's UV coordinates, its normal-map perturbation, and its emission map. */
const TEXTURED = `vec3 w = vec3(1.0 - bary.x - bary.y, bary);
  ivec3 corner = 2 * ivec3(vCorners.xyz);
  vec2 place = w.x * texelFetch(uUvs, at(corner.x), 0).xy + w.y * texelFetch(uUvs, at(corner.y), 0).xy +
    w.z * texelFetch(uUvs, at(corner.z), 0).xy;
  float footprint = length(vAway) * uPixelAngle * vFacing.w * inversesqrt(max(abs(along), 0.05));
  if (vKind.y >= 0) {
    vec4 tangent = vec4(0.0, 0.0, 0.0, texelFetch(uUvs, at(corner.x), 0).z);
    tangent.xyz = w.x * texelFetch(uUvs, at(corner.x + 1), 0).xyz + w.y * texelFetch(uUvs, at(corner.y + 1), 0).xyz +
      w.z * texelFetch(uUvs, at(corner.z + 1), 0).xyz;
    vec3 leant = leaning(vKind.y, place, footprint, n, tangent, along > 0.0 ? -vFacing.xyz : vFacing.xyz);
    ratio = min(max(dot(v2.yzw, leant), 0.0) / max(dot(v2.yzw, n), 1e-12), 4.0);
    n = leant;
  }
  int shining = texelFetch(uMaterials, at(material + ${NUM_GROUPS + 1}), 0).w;
  if (shining >= 0) color *= textureAt(shining, place, footprint);`;

/** The slots about a pixel, and their weights: those of its face where that has one row. */
const SLOTS = `vec2 bary = clamp(vBary, 0.0, 1.0);
  int rows = int(vSide.w), most = max(rows, 1) - 1;
  vec2 where = bary * float(rows);
  int i = clamp(int(where.x), 0, most), j = clamp(int(where.y), 0, most - i);
  vec2 f = where - vec2(i, j);
  bool isFirst = f.x + f.y <= 1.0 || i + j == most;
  int here = int(vSide.x) + i * (rows + 1) - ((i * (i - 1)) >> 1) + j, beside = here + rows + 1 - i;
  ivec3 slots = rows > 1 ? ivec3(isFirst ? here : beside + 1, beside, here + 1) : ivec3(vSide.xyz);
  vec3 weights = isFirst ? vec3(1.0 - f.x - f.y, f) : vec3(f.x + f.y - 1.0, 1.0 - f.y, 1.0 - f.x);
  if (rows == 0) weights = vec3(0.0);`;

export function surfaceShader({ table_rows }: FreeCameraBody, features: SurfaceFeatures): string {
  const { groups, textures, lobes, catchesShadows } = features;
  const sections = [
    lobes && `${elevationRowGlsl(table_rows)}${ENVIRONMENT_GLSL}${LOBES_GLSL}${mirrorGlsl(table_rows)}`,
    textures && `${TEXTURES}${NORMAL_MAP_GLSL}uniform float uPixelAngle;`,
    catchesShadows && `${backgroundGlsl(features.map)}${UNOCCLUDED_GLSL}`,
    needsWholeSurface(features) && "uniform sampler2D uNormals;\nuniform isampler2D uMaterials;\ncentroid in vec3 vAway;",
  ];
  const completeBody = `vec3 d = normalize(vAway);
  float along = dot(vFacing.xyz, d), ratio = 1.0;
  int material = int(vCorners.w) * ${MATERIAL_TEXELS};
  ${lobes ? fetchGlsl("glance", 3) : ""}
  ${lobes || textures ? `vec3 n = ${blendGlsl((k) => `texelFetch(uNormals, at(slots.${k}), 0).xyz`)};\n  n *= inversesqrt(max(dot(n, n), 1e-12));` : ""}
  ${lobes ? `${fetchGlsl("turn", 4)}\n  float more = 0.5 * (dot(turn.xyz, reflect(d, n)) - turn.w);` : ""}
  ${textures ? TEXTURED : ""}
  ${lobes ? "int row;\n  float share;\n  vec3 light = mirrored(vKind.x, n, d, vFacing.xyz, glance, row, share);" : ""}`;
  return `${SHADER_HEADER}${EQUIRECTANGULAR_GLSL}${sections.filter(Boolean).join("\n")}${finishGlsl(features)}
uniform sampler2DArray uValues;
uniform vec3 uGain;
${flatVaryings(features)}
centroid in vec2 vBary;
void main() {
  ${SLOTS}
  vec3 color = vEmission;
  ${fetchGlsl("v0", 0)}
  ${groups ? fetchGlsl("v1", 1) : ""}
  ${groups || textures ? fetchGlsl("v2", 2) : ""}
  ${needsWholeSurface(features) ? completeBody : ""}
  ${groupGlsl(0, "v0.rgb", features, table_rows)}
  ${groups ? groupGlsl(1, "vec3(v0.a, v1.rg)", features, table_rows) : ""}
  ${groups ? groupGlsl(2, "vec3(v1.ba, v2.r)", features, table_rows) : ""}
  color *= uGain;
  float hides = 1.0;
  ${catchesShadows ? SHADOW_CATCHER_GLSL : ""}
  finish(vec4(color, hides));
}
`;
}

/** The background, where no surface is. `uRays` maps a point of the image, −1…1, to a direction. */
export const backgroundShader = (features: ImageFeatures) => `${SHADER_HEADER}${EQUIRECTANGULAR_GLSL}${backgroundGlsl(features.map)}${finishGlsl(features)}
uniform mat3 uRays;
uniform vec2 uSize;
uniform float uFree;
void main() {
  vec3 d = normalize(uRays * vec3(gl_FragCoord.xy / uSize * 2.0 - 1.0, 1.0));
  finish(vec4(uFree * behind(d), 0.0));
}
`;

/** The resolved image, of several samples a pixel, as RGB9_E5: top row first. */
export const encodeShader = (hasAlpha: boolean) => `${SHADER_HEADER}${encodeGlsl(hasAlpha)}
uniform sampler2D uImage;
void main() {
  ivec2 here = ivec2(gl_FragCoord.xy);
  finish(max(texelFetch(uImage, ivec2(here.x, textureSize(uImage, 0).y - 1 - here.y), 0), 0.0));
}
`;
