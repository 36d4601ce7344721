/** Draws surfaces as `primary_visibility`, `shade_pixels` and, for shadow catchers, `background` of
 * `relume.live.free_camera`. Triangles are rasterized; the radiance of lattice nodes is interpolated per pixel. */
import type { FreeCameraBody } from "../../protocol";
import {
  albedoGlsl,
  backgroundGlsl,
  NUM_GROUPS,
  SHADER_HEADER,
  LOBES_GLSL,
  luminanceGlsl,
  MATERIAL_TEXELS,
  EQUIRECTANGULAR_GLSL,
  elevationRowGlsl,
  ENVIRONMENT_GLSL,
} from "./dataLayout";
import type { MaterialFeatures } from "./materials";

/** Features of an image; only these are compiled. */
export interface ImageFeatures {
  /** The background is a map. */
  map: boolean;
  /** Coverage is written. */
  coverage: boolean;
  /** One sample per pixel, written as RGB9_E5. */
  direct: boolean;
}
export type SurfaceFeatures = MaterialFeatures & ImageFeatures;

/** True if pixels need their position and material, besides the outgoing radiance. */
const needsWholeSurface = ({ lobes, textures, catchesShadows }: MaterialFeatures) =>
  lobes || textures || catchesShadows;

/** Per-triangle data: lattice nodes or the first of them, and the number of rows; emission; if needed, corners and
 * material, normal and texture scale, lobe and normal map. */
const flatVaryings = (shows: MaterialFeatures) => `
flat in uvec4 vSide;
flat in vec3 vEmission;
${needsWholeSurface(shows) ? "flat in uvec4 vCorners; flat in vec4 vFacing; flat in ivec2 vKind;" : ""}`;

/** No attributes: everything is fetched by the corner's number. `uRotation` has the camera's axes as columns. */
export const cornerShader = (shows: MaterialFeatures) => `${SHADER_HEADER}
uniform usampler2D uCorners, uSides;
uniform sampler2D uPositions, uFacing;
uniform isampler2D uMaterials;
uniform vec3 uCameraPosition;
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
  vAway = texelFetch(uPositions, at(position), 0).xyz - uCameraPosition;
  vBary = vec2(corner == 1, corner == 2);
  bool isBackFace = dot(facing.xyz, vAway) > 0.0;
  ivec4 kind = texelFetch(uMaterials, at(material + ${NUM_GROUPS}), 0);
  vSide = texelFetch(uSides, at(2 * number + int(isBackFace)), 0);
  vEmission = isBackFace && kind.w == 0 ? vec3(0.0) : intBitsToFloat(texelFetch(uMaterials, at(material + ${NUM_GROUPS + 1}), 0)).rgb;
  ${needsWholeSurface(shows) ? "vCorners = corners; vFacing = facing; vKind = kind.xy;" : ""}
  vec3 cameraSpace = vAway * uRotation;
  gl_Position = vec4(cameraSpace.xy * uFrustum.xy, uFrustum.z * cameraSpace.z + uFrustum.w, -cameraSpace.z);
}
`;

/** Encodes pixels as RGB9_E5, and coverage for sRGB display values, as in other frames. */
const encodeGlsl = (hasAlpha: boolean) => `
layout(location = 0) out vec4 outWord;
${hasAlpha ? "layout(location = 1) out vec4 outCoverage;" : ""}
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
  ${hasAlpha ? "outCoverage = vec4(1.0 - encoded(1.0 - min(pixel.a, 1.0)));" : ""}
}
`;
/** Linear radiance, averaged over a pixel's samples. */
const SAMPLES = `
out vec4 outColor;
void finish(vec4 pixel) { outColor = vec4(min(pixel.rgb, 65000.0), pixel.a); }
`;
const finishGlsl = ({ direct, coverage }: ImageFeatures) => (direct ? encodeGlsl(coverage) : SAMPLES);

/** Trilinear texture lookup, as `relume.live.free_camera.texture_kernels`. */
const TEXTURES = `
uniform sampler2D uTexels, uUvs;
uniform usampler2D uLevels;
int fold(uint wrap, int index, int size) {
  if (wrap == 2u) return clamp(index, 0, size - 1);
  int period = wrap == 0u ? size : 2 * size;
  int folded = index - period * int(floor(float(index) / float(period)));
  return wrap == 0u ? folded : min(folded, 2 * size - 1 - folded);
}
vec3 textureLevel(uvec4 texture, int level, vec2 uv) {
  ivec3 size = ivec3(texelFetch(uLevels, at(int(texture.x) + level), 0).xyz);
  if (texture.z == 0u) uv.x = fract(uv.x);
  if (texture.w == 0u) uv.y = fract(uv.y);
  vec2 texel = uv * vec2(size.z, size.y) - 0.5, below = floor(texel), fraction = texel - below;
  int left = fold(texture.z, int(below.x), size.z), right = fold(texture.z, int(below.x) + 1, size.z);
  int upper = size.x + size.z * fold(texture.w, int(below.y), size.y);
  int lower = size.x + size.z * fold(texture.w, int(below.y) + 1, size.y);
  vec3 top = mix(texelFetch(uTexels, at(upper + left), 0).rgb, texelFetch(uTexels, at(upper + right), 0).rgb, fraction.x);
  return mix(top, mix(texelFetch(uTexels, at(lower + left), 0).rgb, texelFetch(uTexels, at(lower + right), 0).rgb, fraction.x), fraction.y);
}
vec3 textureAt(int number, vec2 uv, float footprint) {
  uvec4 texture = texelFetch(uLevels, at(number), 0);
  uvec2 finest = texelFetch(uLevels, at(int(texture.x)), 0).yz;
  float level = min(log2(max(footprint * float(max(finest.x, finest.y)), 1.0)), float(texture.y) - 1.0);
  int lower = int(level);
  float fraction = level - float(lower);
  vec3 value = textureLevel(texture, lower, uv);
  return fraction > 0.0 ? mix(value, textureLevel(texture, lower + 1, uv), fraction) : value;
}
`;

/** Normal mapping, and its effect on broad lobes, as `relume.live.free_camera.normal_mapping`. */
const NORMAL_MAP_GLSL = `
vec3 mappedNormal(int map, vec2 uv, float footprint, vec3 n, vec4 tangent, vec3 outward) {
  vec3 normal = textureAt(map, uv, footprint);
  vec3 t = tangent.xyz - dot(tangent.xyz, n) * n;
  t *= inversesqrt(max(dot(t, t), 1e-12));
  vec3 b = cross(n, t);
  float side = tangent.w < 0.0 ? -1.0 : 1.0;
  vec3 mapped = normal.x * t + side * normal.y * b + normal.z * n;
  mapped *= inversesqrt(max(dot(mapped, mapped), 1e-12));
  return dot(mapped, outward) <= 0.0 ? n : mapped;
}
`;

/** Unrolled: software rasterizers index vectors through memory. */
const blendGlsl = (value: (k: string) => string) =>
  ["x", "y", "z"].map((k) => `weights.${k} * ${value(k)}`).join(" + ");
const fetchGlsl = (name: string, layer: number) =>
  `vec4 ${name} = ${blendGlsl((k) => `texelFetch(uValues, ivec3(at(slots.${k}), ${layer}), 0)`)};`;

/** Adds the light in a lobe, and the gradient's change by the lobe's rotation, `change` for unit albedo. */
const ADD_LOBE = (albedo: string) => `vec3 albedo = ${albedo}, shown = light * albedo;
      total = max(max(total, -0.5 * shown) + shown, 0.0);
      float whole = dot(${luminanceGlsl}, total);
      total *= 1.0 + clamp(change * dot(${luminanceGlsl}, albedo), -0.125 * whole, 0.125 * whole) / max(whole, 1e-20);`;

/** Adds the outgoing radiance of a group of terms. */
function groupGlsl(number: number, quantity: string, { lobes, textures }: MaterialFeatures, rows: number): string {
  if (!lobes && !textures) return `color += max(${quantity}, 0.0);`;
  const albedo = albedoGlsl(`(vKind.x * ${rows} + row) * ${NUM_GROUPS + 1} + ${number}`);
  return `{
    ivec4 group = texelFetch(uMaterials, at(material + ${number}), 0);
    if (group.z > 0) {
      vec3 total = ratio * ${quantity};
      ${lobes ? ADD_LOBE(albedo) : ""}
      ${textures ? "if (group.w >= 0) total *= textureAt(group.w, uv, footprint);" : ""}
      color += max(total, 0.0);
    }
  }`;
}

const SHADOW_CATCHER_GLSL = `bvec3 isLit;
  vec3 unoccludedLight = uGain * unoccluded(slots, weights, isLit);
  vec3 shown = vec3(uFree);
  for (int channel = 0; channel < 3; channel++) {
    if (isLit[channel] && uGain[channel] > 0.0) shown[channel] = min(color[channel] / unoccludedLight[channel], 8.0);
  }
  color = shown * backgroundRadiance(d);
  coverage -= dot(${luminanceGlsl}, min(shown, 1.0));`;

/** Unoccluded irradiance of shadow catchers. */
const UNOCCLUDED_GLSL = `
uniform usampler2D uPoints;
uniform sampler2D uWeights, uUnoccluded;
uniform float uFree;
vec3 unoccluded(ivec3 slots, vec3 weights, out bvec3 isLit) {
  vec3 sum = vec3(0.0);
  isLit = bvec3(true);
  for (int k = 0; k < 3; k++) {
    uvec4 points = texelFetch(uPoints, at(slots[k]), 0);
    vec4 nodeWeights = texelFetch(uWeights, at(slots[k]), 0);
    vec3 here = vec3(0.0);
    for (int q = 0; q < 4; q++) if (nodeWeights[q] > 0.0) here += nodeWeights[q] * texelFetch(uUnoccluded, at(int(points[q])), 0).rgb;
    sum += weights[k] * here;
    isLit = bvec3(isLit.x && here.x > 0.0, isLit.y && here.y > 0.0, isLit.z && here.z > 0.0);
  }
  return sum;
}
`;

/** The environment in a lobe, and the table row of its albedo. */
const mirrorGlsl = (rows: number) => `
float fractionAbove(float x) { return 1.0 / (1.0 + exp(-1.702 * max(x, -20.0))); }
vec3 mirrored(int lobe, vec3 n, vec3 d, vec3 outward, vec4 visibility, out int row, out float fraction) {
  row = rowOf(clamp(-dot(n, d), 0.01, 1.0), fraction);
  int lobeTexel = (lobe * ${rows} + row) * ${NUM_GROUPS + 1} + ${NUM_GROUPS};
  Lobes lobes = lobesAlong(lobeTexel, fraction, n, d);
  vec3 ray = meanDirection(lobes);
  float along = dot(d, outward), wide = lobeWidth(lobeTexel, fraction);
  float away = dot(ray, outward) * (along > 0.0 ? -1.0 : 1.0);
  float above = min(fractionAbove(away / wide) / fractionAbove(abs(along) / wide), 1.0);
  return above * environmentInLobes(lobes, visibility.xyz);
}
`;

/** A pixel's UV coordinates, mapped normal and emission map. */
const TEXTURED = `vec3 w = vec3(1.0 - bary.x - bary.y, bary);
  ivec3 corner = 2 * ivec3(vCorners.xyz);
  vec2 uv = w.x * texelFetch(uUvs, at(corner.x), 0).xy + w.y * texelFetch(uUvs, at(corner.y), 0).xy +
    w.z * texelFetch(uUvs, at(corner.z), 0).xy;
  float footprint = length(vAway) * uPixelAngle * vFacing.w * inversesqrt(max(abs(along), 0.05));
  if (vKind.y >= 0) {
    vec4 tangent = vec4(0.0, 0.0, 0.0, texelFetch(uUvs, at(corner.x), 0).z);
    tangent.xyz = w.x * texelFetch(uUvs, at(corner.x + 1), 0).xyz + w.y * texelFetch(uUvs, at(corner.y + 1), 0).xyz +
      w.z * texelFetch(uUvs, at(corner.z + 1), 0).xyz;
    vec3 mapped = mappedNormal(vKind.y, uv, footprint, n, tangent, along > 0.0 ? -vFacing.xyz : vFacing.xyz);
    ratio = min(max(dot(v2.yzw, mapped), 0.0) / max(dot(v2.yzw, n), 1e-12), 4.0);
    n = mapped;
  }
  int emissionMap = texelFetch(uMaterials, at(material + ${NUM_GROUPS + 1}), 0).w;
  if (emissionMap >= 0) color *= textureAt(emissionMap, uv, footprint);`;

/** The lattice nodes around a pixel and their weights; the triangle's corners if it has one row. */
const SLOTS = `vec2 bary = clamp(vBary, 0.0, 1.0);
  int rows = int(vSide.w), last = max(rows, 1) - 1;
  vec2 where = bary * float(rows);
  int i = clamp(int(where.x), 0, last), j = clamp(int(where.y), 0, last - i);
  vec2 f = where - vec2(i, j);
  bool isFirst = f.x + f.y <= 1.0 || i + j == last;
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
    needsWholeSurface(features) &&
      "uniform sampler2D uNormals;\nuniform isampler2D uMaterials;\ncentroid in vec3 vAway;",
  ];
  const completeBody = `vec3 d = normalize(vAway);
  float along = dot(vFacing.xyz, d), ratio = 1.0;
  int material = int(vCorners.w) * ${MATERIAL_TEXELS};
  ${lobes ? fetchGlsl("visibility", 3) : ""}
  ${lobes || textures ? `vec3 n = ${blendGlsl((k) => `texelFetch(uNormals, at(slots.${k}), 0).xyz`)};\n  n *= inversesqrt(max(dot(n, n), 1e-12));` : ""}
  ${lobes ? `${fetchGlsl("gradient", 4)}\n  float change = 0.5 * (dot(gradient.xyz, reflect(d, n)) - gradient.w);` : ""}
  ${textures ? TEXTURED : ""}
  ${lobes ? "int row;\n  float fraction;\n  vec3 light = mirrored(vKind.x, n, d, vFacing.xyz, visibility, row, fraction);" : ""}`;
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
  float coverage = 1.0;
  ${catchesShadows ? SHADOW_CATCHER_GLSL : ""}
  finish(vec4(color, coverage));
}
`;
}

/** Draws the background. `uRays` maps an image point, −1…1, to a direction. */
export const backgroundShader = (
  features: ImageFeatures,
) => `${SHADER_HEADER}${EQUIRECTANGULAR_GLSL}${backgroundGlsl(features.map)}${finishGlsl(features)}
uniform mat3 uRays;
uniform vec2 uSize;
uniform float uFree;
void main() {
  vec3 d = normalize(uRays * vec3(gl_FragCoord.xy / uSize * 2.0 - 1.0, 1.0));
  finish(vec4(uFree * backgroundRadiance(d), 0.0));
}
`;

/** Encodes the resolved image as RGB9_E5, top row first. */
export const encodeShader = (hasAlpha: boolean) => `${SHADER_HEADER}${encodeGlsl(hasAlpha)}
uniform sampler2D uImage;
void main() {
  ivec2 here = ivec2(gl_FragCoord.xy);
  finish(max(texelFetch(uImage, ivec2(here.x, textureSize(uImage, 0).y - 1 - here.y), 0), 0.0));
}
`;
