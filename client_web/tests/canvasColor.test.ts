/** Color of the canvases: choices, reasons, calls of the context, and colors in Display P3. */
import { beforeEach, expect, test, vi } from "vitest";
import {
  availableColor,
  configureCanvas,
  readAbilities,
  whyUnavailable,
  type CanvasColor,
} from "../src/render/color/canvasColor";
import { REC709_TO_P3 } from "../src/render/color/displayP3";
import { srgbDecode, srgbEncode } from "../src/render/color/tonemap";
import { transformColor } from "../src/render/color/whiteBalance";
import type { Rgb } from "../src/protocol";

const OLD = {};
const HEADLESS = { drawingBufferColorSpace: "srgb", drawingBufferStorage: () => {} };
const HDR = { ...HEADLESS, drawingBufferToneMapping: () => {} };
const all = () => true;

test.each<[string, CanvasColor, object, (query: string) => boolean, string | null]>([
  ["sRGB anywhere", "srgb", OLD, () => false, null],
  ["P3", "display-p3", HEADLESS, (query) => query.includes("p3"), null],
  ["P3 in an old browser", "display-p3", OLD, all, "Display P3 needs a newer browser."],
  ["P3 on an sRGB screen", "display-p3", HDR, () => false, "Display P3 needs a wide-gamut screen."],
  ["HDR", "hdr", HDR, (query) => query.includes("dynamic-range"), null],
  ["HDR without the canvas", "hdr", HEADLESS, all, "HDR needs a browser with HDR canvases."],
  [
    "HDR on an SDR screen",
    "hdr",
    HDR,
    (query) => query.includes("p3"),
    "HDR needs an HDR screen; turn HDR on in the system settings.",
  ],
])("%s", (_, color, context, matches, reason) => {
  const abilities = readAbilities(context, matches);
  expect(whyUnavailable(color, abilities)).toBe(reason);
  expect(availableColor(color, abilities)).toBe(reason === null ? color : "srgb");
});

function fakeContext(hasToneMapping: boolean) {
  const calls: unknown[] = [];
  const log =
    (name: string) =>
    (...values: unknown[]) =>
      void calls.push([name, ...values]);
  const context = {
    RGBA8: 1,
    RGBA16F: 2,
    drawingBufferColorSpace: "srgb",
    getExtension: () => null,
    drawingBufferStorage: log("storage"),
    ...(hasToneMapping && { drawingBufferToneMapping: log("toneMapping") }),
  };
  return { calls, context, gl: context as unknown as WebGL2RenderingContext };
}

test("HDR canvases have half floats and an extended range, and go back to bytes", () => {
  const { calls, context, gl } = fakeContext(true);
  configureCanvas(gl, "hdr", 30, 20);
  expect(context.drawingBufferColorSpace).toBe("srgb");
  configureCanvas(gl, "display-p3", 30, 20);
  expect(context.drawingBufferColorSpace).toBe("display-p3");
  const [extended, standard] = [{ mode: "extended" }, { mode: "standard" }];
  expect(calls).toEqual([
    ["storage", 2, 30, 20],
    ["toneMapping", extended],
    ["storage", 1, 30, 20],
    ["toneMapping", standard],
  ]);
});

test("browsers without HDR canvases keep their drawing buffer", () => {
  const { calls, context, gl } = fakeContext(false);
  configureCanvas(gl, "srgb", 30, 20);
  expect(calls).toEqual([]);
  expect(context.drawingBufferColorSpace).toBe("srgb");
});

// CSS Color 4: sRGB primaries in display-p3
test.each<[Rgb, Rgb]>([
  [
    [1, 1, 1],
    [1, 1, 1],
  ],
  [
    [1, 0, 0],
    [0.9175, 0.2003, 0.1386],
  ],
  [
    [0, 1, 0],
    [0.4584, 0.9853, 0.2983],
  ],
  [
    [0, 0, 1],
    [0, 0, 0.9596],
  ],
  [
    [0.5, 0.5, 0.5],
    [0.5, 0.5, 0.5],
  ],
])("sRGB %o is %o in Display P3", (color, expected) => {
  const linear = transformColor(REC709_TO_P3, color.map(srgbDecode) as Rgb);
  linear.map(srgbEncode).forEach((v, c) => expect(v).toBeCloseTo(expected[c] as number, 3));
});

beforeEach(() => vi.resetModules());

test("the choice is remembered, and waits for a screen that has it", async () => {
  const stored = new Map([["relume.canvasColor", "hdr"]]);
  vi.stubGlobal("localStorage", {
    getItem: (key: string) => stored.get(key) ?? null,
    setItem: (key: string, value: string) => stored.set(key, value),
  });
  const state = await import("../src/state/canvasColor");
  const listeners: (() => void)[] = [];
  let matches = false;
  const media = () => ({ matches, addEventListener: (_: string, listener: () => void) => listeners.push(listener) });
  state.watchCanvasAbilities(HDR, media as unknown as (query: string) => MediaQueryList);
  expect([state.canvasColorChoice.value, state.canvasColor.value]).toEqual(["hdr", "srgb"]);
  matches = true;
  listeners.forEach((listener) => listener());
  expect(state.canvasColor.value).toBe("hdr");
  state.chooseCanvasColor("display-p3");
  expect([stored.get("relume.canvasColor"), state.canvasColor.value]).toEqual(["display-p3", "display-p3"]);
});
