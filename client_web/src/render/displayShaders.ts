/** One pass: fetch the image's pixel, expose, tone-map, then draw the overlays (brush, outline, wipe).
 *
 * Unused features are not compiled in: a software rasterizer pays for branches not taken, and the plain image is three
 * times as fast without them. */

import { LUT_GAIN, LUT_SIZE, type Rgb } from "../protocol";
import type { CanvasColor } from "./color/canvasColor";
import { MIDDLE_GRAY } from "./color/contrast";
import { BLACK, LMS_TO_ITP, PQ, RANGES, RGB_TO_LMS, SCALES, type DifferenceMode } from "./color/difference";
import { REC709_TO_P3 } from "./color/displayP3";
import type { Matrix } from "./color/whiteBalance";

/** Features of a shader variant, compiled when first needed. */
export interface DisplayFeatures {
  toneMap: "none" | "agx" | "filmic" | "table";
  falseColor: boolean;
  /** Contrast is not neutral. */
  contrast: boolean;
  /** A display LUT follows the tone map. */
  lut: boolean;
  /** The image is minified. */
  isMinified: boolean;
  /** The server has tone-mapped the image already. */
  displayReferred: boolean;
  /** The image has transparent parts, shown over a checkerboard. */
  transparent: boolean;
  compare: boolean;
  /** Show the difference from the A side. */
  difference: DifferenceMode;
  /** The same for the A side. */
  transparentReference: boolean;
  brush: boolean;
  outline: boolean;
  solo: boolean;
  canvasColor: CanvasColor;
}

export const VERTEX = `#version 300 es
void main() {
  vec2 p = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
  gl_Position = vec4(p * 2.0 - 1.0, 0.0, 1.0);
}`;

/** True if the canvas shows more than display values in [0, 1] of Rec. 709: all tone maps but "none", LUTs and
 * differences have no others. */
const isUnbounded = ({ canvasColor, toneMap, falseColor, lut, difference }: DisplayFeatures): boolean =>
  canvasColor !== "srgb" && toneMap === "none" && !falseColor && !lut && difference === "off";

/** Source of a variant. */
export function fragmentShader(features: DisplayFeatures): string {
  const defines = [
    features.falseColor
      ? "FALSE_COLOR"
      : features.toneMap === "agx"
        ? "AGX"
        : features.toneMap === "filmic"
          ? "FILMIC"
          : features.toneMap === "table"
            ? "TABLE"
            : "PLAIN",
    features.contrast && !features.falseColor && "CONTRAST",
    features.lut && !features.falseColor && "LUT",
    features.isMinified && "MINIFIED",
    features.displayReferred && "DISPLAY_REFERRED",
    features.transparent && "TRANSPARENT",
    features.compare && "COMPARE",
    features.difference === "stops" && "DIFFERENCE_STOPS",
    features.difference === "delta_e" && "DIFFERENCE_DELTA_E",
    features.transparentReference && "TRANSPARENT_REFERENCE",
    features.brush && "BRUSH",
    features.outline && "OUTLINE",
    features.solo && "SOLO",
    isUnbounded(features) && "UNBOUNDED",
    features.canvasColor === "display-p3" && "DISPLAY_P3",
    features.canvasColor === "hdr" && "HDR",
  ];
  const lines = defines.flatMap((name) => (name ? [`#define ${name}`] : []));
  const table = [`#define GAIN ${LUT_GAIN.toFixed(1)}`, `#define LAST ${(LUT_SIZE - 1).toFixed(1)}`];
  return ["#version 300 es", ...lines, ...table, FRAGMENT_BODY].join("\n");
}

const vec3Text = (color: Rgb): string => `vec3(${color.map((v) => v.toFixed(8)).join(", ")})`;
/** GLSL's constructor takes columns. */
const mat3Text = (matrix: Matrix): string => `transpose(mat3(${matrix.map(vec3Text).join(", ")}))`;

/** See `color/difference.ts`. */
const DIFFERENCE = `
#ifdef DIFFERENCE_STOPS
vec3 differenceColor(vec3 a, vec3 b) {
  const vec3 weights = vec3(0.2126, 0.7152, 0.0722);
  float levelA = max(dot(uDisplayMatrix * a, weights), 0.0) + ${BLACK}, levelB = max(dot(uDisplayMatrix * b, weights), 0.0) + ${BLACK};
  float t = clamp(log2(levelA / levelB) / ${RANGES.stops.toFixed(1)}, -1.0, 1.0);
  return mix(${vec3Text(SCALES.stops[1])}, t < 0.0 ? ${vec3Text(SCALES.stops[0])} : ${vec3Text(SCALES.stops[2])}, abs(t));
}
#endif

#ifdef DIFFERENCE_DELTA_E
vec3 itp(vec3 x) {
  vec3 power = pow(max(${mat3Text(RGB_TO_LMS)} * decoded(x), 0.0) / 100.0, vec3(${PQ.m1}));
  return ${mat3Text(LMS_TO_ITP)} * pow((${PQ.c1} + ${PQ.c2} * power) / (1.0 + ${PQ.c3} * power), vec3(${PQ.m2}));
}

vec3 differenceColor(vec3 a, vec3 b) {
  float t = clamp(720.0 * distance(itp(display(a)), itp(display(b))) / ${RANGES.delta_e.toFixed(1)}, 0.0, 1.0);
  return t < 0.5 ? mix(${vec3Text(SCALES.delta_e[0])}, ${vec3Text(SCALES.delta_e[1])}, 2.0 * t)
    : mix(${vec3Text(SCALES.delta_e[1])}, ${vec3Text(SCALES.delta_e[2])}, 2.0 * t - 1.0);
}
#endif
`;

const FRAGMENT_BODY = `precision highp float;
precision highp usampler2D;

uniform sampler2D uImage;    // linear radiance
uniform sampler2D uReference;  // the A side of a comparison, linear radiance
uniform sampler2D uDisplay;    // an image that the server has tone-mapped already
uniform sampler2D uBrush;      // 0..1: fraction of each pixel's light from an interval of the curve
uniform sampler2D uAlpha;      // coverage of each pixel; radiance is premultiplied
uniform sampler2D uReferenceAlpha;  // the same for the A side
uniform usampler2D uIds;       // material of each pixel, 65535 = background
uniform vec2 uCanvas;          // device pixels
uniform vec4 uImageRect;           // left, top, width, height of the image, device pixels from the top left
uniform vec2 uSize;            // size of the image in pixels
uniform mat3 uDisplayMatrix;   // exposure times white balance
uniform float uContrast;       // slope of log radiance about middle gray
uniform float uWipe;           // fraction of the image left of which the A side shows
uniform int uHover;            // material to outline
uniform int uSolo;             // solo material
uniform vec3 uSurround;
out vec4 outColor;

const vec3 ACCENT = vec3(0.941, 0.706, 0.235);

vec3 encoded(vec3 x) {
  return mix(12.92 * x, 1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, step(vec3(0.0031308), x));
}

vec3 srgb(vec3 x) {
  return encoded(clamp(x, 0.0, 1.0));
}

#if defined(DIFFERENCE_DELTA_E) || defined(DISPLAY_P3)
vec3 decoded(vec3 x) {
  return mix(x / 12.92, pow((x + 0.055) / 1.055, vec3(2.4)), step(vec3(0.04045), x));
}
#endif

// display values of Rec. 709, beyond [0, 1] if unbounded, in the color space of the canvas
vec3 canvasColor(vec3 color) {
#ifdef DISPLAY_P3
  return srgb(${mat3Text(REC709_TO_P3)} * (sign(color) * decoded(abs(color))));
#else
  return color;
#endif
}

vec3 agx(vec3 x) {
  const mat3 inset = mat3(0.842479062253094, 0.0423282422610123, 0.0423756549057051, 0.0784335999999992,
    0.878468636469772, 0.0784336, 0.0792237451477643, 0.0791661274605434, 0.879142973793104);
  const mat3 outset = mat3(1.19687900512017, -0.0528968517574562, -0.0529716355144438, -0.0980208811401368,
    1.15190312990417, -0.0980434501171241, -0.0990297440797205, -0.0989611768448433, 1.15107367264116);
  x = (clamp(log2(max(inset * x, 1e-10)), -12.47393, 4.026069) + 12.47393) / 16.499999;
  vec3 x2 = x * x, x4 = x2 * x2;
  x = 15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
  return clamp(outset * x, 0.0, 1.0);
}

vec3 filmic(vec3 x) {
  return srgb((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14));
}

#if defined(TABLE) || defined(LUT)
vec3 node(highp sampler3D nodes, vec3 at) {
  return texelFetch(nodes, ivec3(at.bgr), 0).rgb;
}

// tetrahedral interpolation: corners at 0, plus the largest fraction's axis, minus the smallest's, at 1
vec3 interpolated(highp sampler3D nodes, vec3 coordinate, float last) {
  const vec3 R = vec3(1.0, 0.0, 0.0), G = vec3(0.0, 1.0, 0.0), B = vec3(0.0, 0.0, 1.0);
  vec3 at = min(floor(coordinate), last - 1.0);
  vec3 fraction = coordinate - at;
  vec3 longest = fraction.r >= fraction.g ? (fraction.r >= fraction.b ? R : B) : (fraction.g >= fraction.b ? G : B);
  vec3 shortest = fraction.r < fraction.g ? (fraction.r < fraction.b ? R : B) : (fraction.g < fraction.b ? G : B);
  float largest = dot(fraction, longest), smallest = dot(fraction, shortest), middle = fraction.r + fraction.g + fraction.b - largest - smallest;
  return (1.0 - largest) * node(nodes, at) + (largest - middle) * node(nodes, at + longest)
    + (middle - smallest) * node(nodes, at + 1.0 - shortest) + smallest * node(nodes, at + 1.0);
}
#endif

#ifdef TABLE
uniform highp sampler3D uTable;  // display values; blue is the quickest

vec3 table(vec3 x) {
  vec3 shaped = log2(1.0 + GAIN * sqrt(max(x, 0.0))) / (2.0 * log2(1.0 + GAIN));
  return interpolated(uTable, min(shaped, 1.0) * LAST, LAST);
}
#endif

#ifdef LUT
uniform highp sampler3D uLut;  // display values by display values

vec3 displayLut(vec3 x) {
  float last = float(textureSize(uLut, 0).x - 1);
  return interpolated(uLut, clamp(x, 0.0, 1.0) * last, last);
}
#endif

// luminance in stops relative to middle gray, one color per two stops, black and white at the ends
vec3 falseColor(vec3 x) {
  float stops = log2(max(dot(x, vec3(0.2126, 0.7152, 0.0722)), 1e-6) / 0.18);
  if (stops < -6.0) return vec3(0.02);
  if (stops < -4.0) return vec3(0.22, 0.10, 0.45);
  if (stops < -2.0) return vec3(0.12, 0.30, 0.75);
  if (stops < -0.5) return vec3(0.10, 0.60, 0.65);
  if (stops < 0.5) return vec3(0.45);
  if (stops < 2.0) return vec3(0.35, 0.70, 0.25);
  if (stops < 4.0) return vec3(0.95, 0.80, 0.15);
  if (stops < 6.0) return vec3(0.90, 0.35, 0.10);
  return vec3(1.0);
}

vec3 toneMapped(vec3 x) {
#ifdef CONTRAST
  x = sign(x) * min(${MIDDLE_GRAY} * pow(abs(x) / ${MIDDLE_GRAY}, vec3(uContrast)), 1e9);  // tone maps square it
#endif
#if defined(AGX)
  return agx(x);
#elif defined(FILMIC)
  return filmic(x);
#elif defined(TABLE)
  return table(x);
#elif defined(UNBOUNDED) && defined(HDR)
  return sign(x) * encoded(abs(x));
#elif defined(UNBOUNDED)
  x = min(x, 1.0);
  return sign(x) * encoded(abs(x));
#else
  return srgb(x);
#endif
}

vec3 display(vec3 x) {
  x = uDisplayMatrix * x;
#ifndef UNBOUNDED
  x = max(x, 0.0);
#endif
#if defined(FALSE_COLOR)
  return falseColor(x);
#elif defined(LUT)
  return displayLut(toneMapped(x));
#else
  return toneMapped(x);
#endif
}

vec3 radiance(vec2 uv, bool reference) {
#ifdef COMPARE
  if (reference) return texture(uReference, uv).rgb;
#endif
  return texture(uImage, uv).rgb;
}

float alpha(vec2 uv, bool reference) {
#ifdef TRANSPARENT
  if (!reference) return texture(uAlpha, uv).r;
#endif
#ifdef TRANSPARENT_REFERENCE
  if (reference) return texture(uReferenceAlpha, uv).r;
#endif
  return 1.0;
}

// premultiplied radiance and coverage
vec4 sampled(vec2 uv, bool reference) {
  return vec4(radiance(uv, reference), alpha(uv, reference));
}

// filtered: shared exponents cannot be mipmapped, so four taps across the pixel footprint
vec4 filtered(vec2 uv, bool reference) {
#ifdef MINIFIED
  vec2 d = (uSize / uImageRect.zw - 1.0) * 0.25 / uSize;
  return 0.25 * (sampled(uv + d, reference) + sampled(uv - d, reference)
    + sampled(uv + vec2(d.x, -d.y), reference) + sampled(uv + vec2(-d.x, d.y), reference));
#else
  return sampled(uv, reference);
#endif
}

vec3 checkerboard() {
  vec2 at = floor(gl_FragCoord.xy / 10.0);
  return vec3(mod(at.x + at.y, 2.0) < 0.5 ? 0.27 : 0.36);
}

vec3 displayed(vec2 uv, bool reference) {
  vec4 light = filtered(uv, reference);
#if defined(TRANSPARENT) || defined(TRANSPARENT_REFERENCE)
  return mix(checkerboard(), display(light.rgb / max(light.a, 1.0 / 512.0)), light.a);
#else
  return display(light.rgb);
#endif
}

${DIFFERENCE}
int idAt(vec2 uv) {
  ivec2 p = clamp(ivec2(uv * uSize), ivec2(0), ivec2(uSize) - 1);
  return int(texelFetch(uIds, p, 0).r);
}

bool outlined(vec2 uv) {
  bool inside = idAt(uv) == uHover;
  vec2 d = 1.5 / uImageRect.zw;
  for (int i = 0; i < 4; i++) {
    vec2 o = i < 2 ? vec2(float(i) * 2.0 - 1.0, 0.0) : vec2(0.0, float(i - 2) * 2.0 - 1.0);
    if ((idAt(uv + o * d) == uHover) != inside) return true;
  }
  return false;
}

void main() {
  vec2 screen = vec2(gl_FragCoord.x, uCanvas.y - gl_FragCoord.y);
  vec2 uv = (screen - uImageRect.xy) / uImageRect.zw;
  if (any(lessThan(uv, vec2(0.0))) || any(greaterThanEqual(uv, vec2(1.0)))) {
    outColor = vec4(uSurround, 1.0);
    return;
  }
  bool reference = false;
#ifdef COMPARE
  reference = uv.x < uWipe;
#endif
#if defined(DIFFERENCE_STOPS) || defined(DIFFERENCE_DELTA_E)
  vec3 color = differenceColor(filtered(uv, true).rgb, filtered(uv, false).rgb);
#elif defined(DISPLAY_REFERRED)
  vec3 color = reference ? displayed(uv, true) : texture(uDisplay, uv).rgb;
#ifdef TRANSPARENT
  if (!reference) color += (1.0 - filtered(uv, false).a) * checkerboard();
#endif
#else
  vec3 color = displayed(uv, reference);
#endif
#ifdef BRUSH
  if (!reference) {
    float fraction = texture(uBrush, uv).r;
    float gray = dot(color, vec3(0.2126, 0.7152, 0.0722));
    color = mix(vec3(gray * 0.6), ACCENT, sqrt(fraction) * 0.9);
  }
#endif
#ifdef SOLO
  if (idAt(uv) != uSolo) color = vec3(0.08 + 0.3 * dot(color, vec3(0.2126, 0.7152, 0.0722)));
#endif
#ifdef OUTLINE
  if (outlined(uv)) color = ACCENT;
#endif
  outColor = vec4(canvasColor(color), 1.0);
}`;
