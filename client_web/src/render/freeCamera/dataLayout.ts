/** GLSL shared by the free-camera shaders: texel addressing, table rows, the environment. */

/** Texels per texture row; texels are numbered row by row. */
export const TEXELS_PER_ROW = 2048;
/** Groups of terms: untextured, with a diffuse texture, with a specular texture. */
export const NUM_GROUPS = 3;
/** Per group: whether it has a table over θo, and one over θo and φo. */
export interface TableKinds {
  isotropic: readonly boolean[];
  anisotropic: readonly boolean[];
}
/** Texels per material: groups, lobe and normal map, emission, tables of the highlights. */
export const MATERIAL_TEXELS = 2 * NUM_GROUPS + 2;
/** Maximum number of bright environment lights. */
export const MAX_BRIGHT_LIGHTS = 2;

export const SHADER_HEADER = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
precision highp usampler2D;
precision highp isampler2D;
ivec2 at(int texel) { return ivec2(texel & ${TEXELS_PER_ROW - 1}, texel >> ${Math.log2(TEXELS_PER_ROW)}); }
`;

/** One triangle over the whole target, at the far plane. */
export const FULLSCREEN_VERTEX = `#version 300 es
void main() {
  gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 1.0, 1.0);
}
`;

/** Table row of cos θo, and the interpolation fraction to the next row. */
export const elevationRowGlsl = (rows: number) => `
int rowOf(float cosine, out float fraction) {
  float coordinate = sqrt(max(1.0 - cosine, 0.0)) * ${(rows - 1).toFixed(1)};
  int row = min(int(coordinate), ${rows - 2});
  fraction = coordinate - float(row);
  return row;
}
`;

/** Equirectangular coordinates of a unit direction. Inverse trigonometry by polynomials of Abramowitz and Stegun (4.4.46,
 * 4.4.47), error below 1e-5 radians: the built-in functions dominate the cost of a background in software. */
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
vec2 equirectangular(vec3 d) { return vec2(arcTangent(d.z, d.x) * 0.5 / PI + uTurn, arcCosine(d.y) / PI); }
`;

/** Radiance of a mip level of an environment map: bilinear, periodic in u. A level is (first texel, height, width). */
export const ENVIRONMENT_GLSL = `
uniform sampler2D uEnvironment;
vec3 environmentTexel(ivec3 level, int row, int column) { return texelFetch(uEnvironment, at(level.x + row * level.z + column), 0).rgb; }
vec3 environmentAt(ivec3 level, vec2 uv) {
  float x = uv.x * float(level.z) - 0.5;
  float y = clamp(uv.y * float(level.y) - 0.5, 0.0, float(level.y - 1));
  float left = floor(x), upper = floor(y), fx = x - left, fy = y - upper;
  int column = int(left) - level.z * int(floor(left / float(level.z)));
  int beside = column + 1 == level.z ? 0 : column + 1, row = int(upper), below = min(row + 1, level.y - 1);
  vec3 top = mix(environmentTexel(level, row, column), environmentTexel(level, row, beside), fx);
  return mix(top, mix(environmentTexel(level, below, column), environmentTexel(level, below, beside), fx), fy);
}
`;

/** Maximum number of mip levels of an environment: sharp, then increasingly blurred. */
export const ENVIRONMENT_LEVELS = 12;

/** The directions of a lobe pair, and the prefiltered environment along them, as
 * `relume.live.free_camera.highlights.environment_lobe_lookup`. `lobeTexel`: texel of its table. */
export const LOBES_GLSL = `
uniform sampler2D uLobes;
uniform ivec3 uEnvironmentLevels[${ENVIRONMENT_LEVELS}];
uniform int uNumEnvironmentLevels, uNumBrightLights;
uniform vec3 uEnvironmentGain;
uniform vec4 uBrightLightDirections[${MAX_BRIGHT_LIGHTS}];
uniform vec3 uBrightLightRadiances[${MAX_BRIGHT_LIGHTS}];
struct Lobes { vec3 first, second; float firstWeight, sigma, sigma2; };
float levelOf(float sigma) { return max(2.0 * log2(max(sigma * 180.0 / PI / 2.0, 1e-3)) + 1.0, 0.0); }
vec3 prefilteredEnvironment(vec3 direction, float sigma) {
  float level = min(levelOf(sigma), float(uNumEnvironmentLevels - 1));
  int lower = int(level);
  float fraction = level - float(lower);
  vec2 uv = equirectangular(direction);
  vec3 radiance = environmentAt(uEnvironmentLevels[lower], uv);
  return fraction > 0.0 ? mix(radiance, environmentAt(uEnvironmentLevels[lower + 1], uv), fraction) : radiance;
}
vec3 brightLightInLobe(int light, vec3 direction, float sigma) {
  vec4 towards = uBrightLightDirections[light];
  float per = 1.0 / (sigma * sigma + towards.w), near = exp(-per * (1.0 - dot(direction, towards.xyz)));
  return min(levelOf(sigma), 1.0) * near * per * 0.5 / PI / (1.0 - exp(-2.0 * per)) * uBrightLightRadiances[light];
}
vec3 environmentInLobe(vec3 direction, float sigma, vec3 visibility) {
  vec3 radiance = visibility.x * prefilteredEnvironment(direction, sigma);
  if (uNumBrightLights > 0) radiance += visibility.y * brightLightInLobe(0, direction, sigma);
  if (uNumBrightLights > 1) radiance += visibility.z * brightLightInLobe(1, direction, sigma);
  return uEnvironmentGain * radiance;
}
vec3 tangentialDirection(vec3 n, vec3 d) {
  vec3 aside = d - dot(n, d) * n;
  return aside * inversesqrt(max(dot(aside, aside), 1e-20));
}
vec3 tiltTowards(float cosine, vec3 aside, vec3 n) { return sqrt(max(1.0 - cosine * cosine, 0.0)) * aside + cosine * n; }
vec4 lobeRow(int texel, float fraction) { return mix(texelFetch(uLobes, at(texel), 0), texelFetch(uLobes, at(texel + ${NUM_GROUPS + 1}), 0), fraction); }
Lobes lobesAlong(int lobeTexel, float fraction, vec3 n, vec3 d) {
  vec4 shape = lobeRow(lobeTexel, fraction);
  vec3 aside = tangentialDirection(n, d);
  return Lobes(tiltTowards(shape.x, aside, n), tiltTowards(shape.y, aside, n), shape.z, shape.w, lobeRow(lobeTexel - 2, fraction).a);
}
float lobeWidth(int lobeTexel, float fraction) { return lobeRow(lobeTexel - 1, fraction).a; }
vec3 meanDirection(Lobes lobes) {
  vec2 length = 1.0 - vec2(lobes.sigma * lobes.sigma, lobes.sigma2 * lobes.sigma2);
  return normalize(lobes.firstWeight * length.x * lobes.first + (1.0 - lobes.firstWeight) * length.y * lobes.second);
}
vec3 environmentInLobes(Lobes lobes, vec3 visibility) {
  return mix(environmentInLobe(lobes.second, lobes.sigma2, visibility), environmentInLobe(lobes.first, lobes.sigma, visibility), lobes.firstWeight);
}
`;
/** Albedo of a lobe in a group of terms, interpolated between table rows. */
export const albedoGlsl = (lobe: string) =>
  `mix(texelFetch(uLobes, at(${lobe}), 0).rgb, texelFetch(uLobes, at(${lobe} + ${NUM_GROUPS + 1}), 0).rgb, fraction)`;

/** Difference of that albedo between neighboring rows. */
export const albedoStepGlsl = (lobe: string) =>
  `(texelFetch(uLobes, at(${lobe} + ${NUM_GROUPS + 1}), 0).rgb - texelFetch(uLobes, at(${lobe}), 0).rgb)`;
/** Y of linear Rec. 709. */
export const LUMINANCE = [0.2126, 0.7152, 0.0722] as const;
export const luminanceGlsl = `vec3(${LUMINANCE.join(", ")})`;

/** The background radiance: a map or a color. */
export const backgroundGlsl = (isMap: boolean) =>
  isMap
    ? `
uniform sampler2D uBackground;
uniform vec3 uBackgroundGain;
vec3 backgroundRadiance(vec3 d) { return uBackgroundGain * textureLod(uBackground, equirectangular(d), 0.0).rgb; }
`
    : `
uniform vec3 uBackgroundColor;
vec3 backgroundRadiance(vec3 d) { return uBackgroundColor; }
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
