/** Variants of the display shader. */
import { expect, test } from "vitest";
import { fragmentShader, type DisplayFeatures } from "../src/render/displayShaders";

const PLAIN: DisplayFeatures = {
  toneMap: "none",
  falseColor: false,
  contrast: false,
  lut: false,
  isMinified: false,
  displayReferred: false,
  transparent: false,
  compare: false,
  difference: "off",
  transparentReference: false,
  brush: false,
  outline: false,
  solo: false,
  canvasColor: "srgb",
};
const ALL: DisplayFeatures = {
  toneMap: "none",
  falseColor: false,
  contrast: true,
  lut: true,
  isMinified: true,
  displayReferred: true,
  transparent: true,
  compare: true,
  difference: "stops",
  transparentReference: true,
  brush: true,
  outline: true,
  solo: true,
  canvasColor: "srgb",
};
const VARIANTS: DisplayFeatures[] = [
  ALL,
  { ...ALL, toneMap: "agx" },
  { ...ALL, toneMap: "filmic" },
  { ...ALL, toneMap: "table" },
  { ...ALL, falseColor: true },
  { ...ALL, difference: "delta_e" },
  { ...PLAIN, canvasColor: "display-p3" },
  { ...PLAIN, canvasColor: "hdr" },
];

const definitions = (features: DisplayFeatures): string[] =>
  [...fragmentShader(features).matchAll(/^#define ([A-Z_0-9]+)$/gm)].map(([, name]) => name as string);
const conditions = (source: string): string[] =>
  [...source.matchAll(/^#(?:ifdef|ifndef|if|elif) (.*)$/gm)].flatMap(([, text]) => text?.match(/[A-Z_0-9]+/g) ?? []);

test("each condition of the shader is a feature, so that no code is dead", () => {
  const defined = new Set(VARIANTS.flatMap(definitions));
  expect(conditions(fragmentShader(PLAIN)).filter((name) => !defined.has(name))).toEqual([]);
});

test("each feature but the plain tone map is tested by the shader", () => {
  const tested = new Set([...conditions(fragmentShader(PLAIN)), "PLAIN"]);
  expect(VARIANTS.flatMap(definitions).filter((name) => !tested.has(name))).toEqual([]);
});

test("standard canvases show display values as they are", () => {
  expect(definitions(PLAIN)).toEqual(["PLAIN"]);
});

test.each<[string, Partial<DisplayFeatures>, boolean]>([
  ["no tone map", {}, true],
  ["AgX", { toneMap: "agx" }, false],
  ["a view", { toneMap: "table" }, false],
  ["a LUT", { lut: true }, false],
  ["false color", { falseColor: true }, false],
  ["a difference", { difference: "delta_e" }, false],
])("an HDR canvas with %s", (_, features, expected) => {
  expect(definitions({ ...PLAIN, canvasColor: "hdr", ...features }).includes("UNBOUNDED")).toBe(expected);
});
