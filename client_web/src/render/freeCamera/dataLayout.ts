/** What all shaders of a free-camera view share: how texels are addressed, the rows of tables, the environment. */

/** Texels are numbered through rows of this many. */
export const TEXELS_PER_ROW = 2048;
/** Groups of terms: untextured, then those that a diffuse and a specular texture multiply. */
export const NUM_GROUPS = 3;
/** Which groups have a table over θo alone, and which one over φo too. */
export interface TableKinds {
  isotropic: readonly boolean[];
  anisotropic: readonly boolean[];
}
/** Texels of one material: its groups, its lobe and its normal map, its emission, the tables of its highlights. */
export const MATERIAL_TEXELS = 2 * NUM_GROUPS + 2;
/** Maximum number of bright environment lights. */
export const MAX_SKY_LAMPS = 2;

export const SHADER_HEADER = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
precision highp usampler2D;
precision highp isampler2D;
ivec2 at(int texel) { return ivec2(texel & ${TEXELS_PER_ROW - 1}, texel >> ${Math.log2(TEXELS_PER_ROW)}); }
`;

/** Covers everything with one triangle, behind all others. */
export const FULLSCREEN_VERTEX = `#version 300 es
void main() {
  gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 1.0, 1.0);
}
`;

/** Where cos θo lies in tables of so many rows: a row, and the fraction of the next. */
export const elevationRowGlsl = (rows: number) => `
int rowOf(float cosine, out float share) {
  float place = sqrt(max(1.0 - cosine, 0.0)) * ${(rows - 1).toFixed(1)};
  int row = min(int(place), ${rows - 2});
  share = place - float(row);
  return row;
}
`;

/** Where a unit direction lies in equirectangular maps: arc functions by polynomials of Abramowitz and Stegun
 * (4.4.46, 4.4.47), at most 1e-5 radians off: those of the language are what software pays most for in a background. */
export const EQUIRECTANGULAR_GLSL = `
uniform float uTurn;
const float PI = 3.14159265358979;
float arcTangent(float y, float x) {
  vec2 size = abs(vec2(x, y));
  float ratio = min(size.x, size.y) / max(max(size.x, size.y), 1e-30), q = ratio * ratio;
  float angle = ratio * (0.9998660 + q * (-0.3302995 + q * (0.1801410 + q * (-0.0851330 + q * 0.0208351))));
  angle = size.y > size.x ? 0.5 * PI - angle : angle;
  angle = x < 0.0 ? PI - angle : angle;
  return y < 0.0 ? -angle : angle;
}
float arcCosine(float x) {
  float size = min(abs(x), 1.0);
  float angle = sqrt(1.0 - size) * (1.5707963050 + size * (-0.2145988016 + size * (0.0889789874 + size * (-0.0501743046 +
    size * (0.0308918810 + size * (-0.0170881256 + size * (0.0066700901 - 0.0012624911 * size)))))));
  return x < 0.0 ? PI - angle : angle;
}
vec2 placeOf(vec3 d) { return vec2(arcTangent(d.z, d.x) * 0.5 / PI + uTurn, arcCosine(d.y) / PI); }
`;

/** The light of a level of a map: bilinear, round about in u. A level is first texel, height, width. */
export const ENVIRONMENT_GLSL = `
uniform sampler2D uSky;
vec3 skyTexel(ivec3 level, int row, int column) { return texelFetch(uSky, at(level.x + row * level.z + column), 0).rgb; }
vec3 skyAt(ivec3 level, vec2 place) {
  float x = place.x * float(level.z) - 0.5;
  float y = clamp(place.y * float(level.y) - 0.5, 0.0, float(level.y - 1));
  float left = floor(x), upper = floor(y), fx = x - left, fy = y - upper;
  int column = int(left) - level.z * int(floor(left / float(level.z)));
  int beside = column + 1 == level.z ? 0 : column + 1, row = int(upper), below = min(row + 1, level.y - 1);
  vec3 top = mix(skyTexel(level, row, column), skyTexel(level, row, beside), fx);
  return mix(top, mix(skyTexel(level, below, column), skyTexel(level, below, beside), fx), fy);
}
`;

/** The most levels of a sky: sharp, then blurred ever more. */
export const ENVIRONMENT_LEVELS = 12;

/** The direction of a lobe, and the prefiltered environment along it (relume.live.free_camera.highlights.environment_lobe_lookup). The texel `of` of its table. */
export const LOBES_GLSL = `
uniform sampler2D uLobes;
uniform ivec3 uSkyLevels[${ENVIRONMENT_LEVELS}];
uniform int uNumSkyLevels, uNumLamps;
uniform vec3 uSkyGain;
uniform vec4 uLampDirections[${MAX_SKY_LAMPS}];
uniform vec3 uLampLights[${MAX_SKY_LAMPS}];
struct Lobes { vec3 one, other; float first, sigma, sigma2; };
float levelOf(float sigma) { return max(2.0 * log2(max(sigma * 180.0 / PI / 2.0, 1e-3)) + 1.0, 0.0); }
vec3 skyAbout(vec3 direction, float sigma) {
  float place = min(levelOf(sigma), float(uNumSkyLevels - 1));
  int lower = int(place);
  float share = place - float(lower);
  vec2 where = placeOf(direction);
  vec3 found = skyAt(uSkyLevels[lower], where);
  return share > 0.0 ? mix(found, skyAt(uSkyLevels[lower + 1], where), share) : found;
}
vec3 lampAbout(int lamp, vec3 direction, float sigma) {
  vec4 towards = uLampDirections[lamp];
  float per = 1.0 / (sigma * sigma + towards.w), near = exp(-per * (1.0 - dot(direction, towards.xyz)));
  return min(levelOf(sigma), 1.0) * near * per * 0.5 / PI / (1.0 - exp(-2.0 * per)) * uLampLights[lamp];
}
vec3 skyInLobe(vec3 direction, float sigma, vec3 seen) {
  vec3 found = seen.x * skyAbout(direction, sigma);
  if (uNumLamps > 0) found += seen.y * lampAbout(0, direction, sigma);
  if (uNumLamps > 1) found += seen.z * lampAbout(1, direction, sigma);
  return uSkyGain * found;
}
vec3 asideOf(vec3 n, vec3 d) {
  vec3 aside = d - dot(n, d) * n;
  return aside * inversesqrt(max(dot(aside, aside), 1e-20));
}
vec3 leanTo(float cosine, vec3 aside, vec3 n) { return sqrt(max(1.0 - cosine * cosine, 0.0)) * aside + cosine * n; }
vec4 lobeRow(int texel, float share) { return mix(texelFetch(uLobes, at(texel), 0), texelFetch(uLobes, at(texel + ${NUM_GROUPS + 1}), 0), share); }
Lobes alongBoth(int of, float share, vec3 n, vec3 d) {
  vec4 shape = lobeRow(of, share);
  vec3 aside = asideOf(n, d);
  return Lobes(leanTo(shape.x, aside, n), leanTo(shape.y, aside, n), shape.z, shape.w, lobeRow(of - 2, share).a);
}
float wideOf(int of, float share) { return lobeRow(of - 1, share).a; }
vec3 middleOf(Lobes lobes) {
  vec2 length = 1.0 - vec2(lobes.sigma * lobes.sigma, lobes.sigma2 * lobes.sigma2);
  return normalize(lobes.first * length.x * lobes.one + (1.0 - lobes.first) * length.y * lobes.other);
}
vec3 skyInBoth(Lobes lobes, vec3 seen) {
  return mix(skyInLobe(lobes.other, lobes.sigma2, seen), skyInLobe(lobes.one, lobes.sigma, seen), lobes.first);
}
`;
/** The albedo of a lobe in a group of terms, whose texel of a table is `of`. */
export const albedoGlsl = (lobe: string) =>
  `mix(texelFetch(uLobes, at(${lobe}), 0).rgb, texelFetch(uLobes, at(${lobe} + ${NUM_GROUPS + 1}), 0).rgb, share)`;

/** How that changes from a row to the next. */
export const albedoStepGlsl = (lobe: string) => `(texelFetch(uLobes, at(${lobe} + ${NUM_GROUPS + 1}), 0).rgb - texelFetch(uLobes, at(${lobe}), 0).rgb)`;
/** Y of linear Rec. 709. */
export const LUMINANCE = [0.2126, 0.7152, 0.0722] as const;
export const luminanceGlsl = `vec3(${LUMINANCE.join(", ")})`;

/** What lies behind surfaces: a map, or one color. */
export const backgroundGlsl = (isMap: boolean) =>
  isMap
    ? `
uniform sampler2D uBackground;
uniform vec3 uBackgroundGain;
vec3 behind(vec3 d) { return uBackgroundGain * textureLod(uBackground, placeOf(d), 0.0).rgb; }
`
    : `
uniform vec3 uBackgroundColor;
vec3 behind(vec3 d) { return uBackgroundColor; }
`;

/** Texels [start, end) of an array as rectangles of its rows: left, top, width, height. */
export function rectanglesOf(start: number, end: number): [number, number, number, number][] {
  const [first, last] = [Math.ceil(start / TEXELS_PER_ROW), Math.floor(end / TEXELS_PER_ROW)];
  if (first > last) return [[start % TEXELS_PER_ROW, last, end - start, 1]];
  const rectangles: [number, number, number, number][] = [
    [start % TEXELS_PER_ROW, first - 1, first * TEXELS_PER_ROW - start, 1],
    [0, first, TEXELS_PER_ROW, last - first],
    [0, last, end - last * TEXELS_PER_ROW, 1],
  ];
  return rectangles.filter(([, , width, height]) => width > 0 && height > 0);
}
