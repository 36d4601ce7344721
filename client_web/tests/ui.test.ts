import { describe, expect, test } from "vitest";
import { parseGauge } from "../src/app/parseMetrics";
import { fromHex, peakValue, toHex } from "../src/render/color/colorMath";
import { defaultTerm, modelsFor, withModel } from "../src/panels/inspector/terms";
import { nextName } from "../src/panels/looks/lookNames";
import type { ModelBody, Rgb } from "../src/protocol";
import { parseUrl, formatUrl } from "../src/session/scene/url";
import { formatShortcut } from "../src/ui/chord";
import {
  formatBytes,
  formatNumber,
  formatEstimatedTime,
  formatSeconds,
  fromFraction,
  keyStep,
  parseNumber,
  snap,
  tickLabel,
  toFraction,
} from "../src/ui/scale";

describe("slider scales", () => {
  const log = { minimum: 0.01, maximum: 1, scale: "log" } as const;
  const linear = { minimum: 1, maximum: 5, scale: "linear" } as const;

  test("a log slider's middle is the geometric mean", () => {
    expect(fromFraction(log, 0.5)).toBeCloseTo(0.1, 6);
    expect(toFraction(log, 0.1)).toBeCloseTo(0.5, 9);
    expect(fromFraction(linear, 0.5)).toBe(3);
  });

  test("the ends are exact and nothing leaves them", () => {
    for (const range of [log, linear]) {
      expect([fromFraction(range, 0), fromFraction(range, 1)]).toEqual([range.minimum, range.maximum]);
      expect(fromFraction(range, 7)).toBe(range.maximum);
      expect(toFraction(range, -4)).toBe(0);
    }
  });

  test("whole numbers stay whole, and a key moves by one of them", () => {
    const whole = { minimum: 0, maximum: 24, scale: "linear", step: 1 } as const;
    expect(fromFraction(whole, 0.49)).toBe(12);
    expect(snap(whole, 3.7)).toBe(4);
    expect(fromFraction(whole, toFraction(whole, 5) + keyStep(whole))).toBe(6);
    expect(keyStep(linear)).toBe(0.01);
  });

  test("values are tidy", () => {
    expect(String(fromFraction(linear, 1 / 3)).length).toBeLessThanOrEqual(6);
  });
});

describe("numbers", () => {
  test("are written as people read them", () => {
    expect([0, 0.2, 12.345, 123.45, 12345, 1e-7, Number.NaN].map(formatNumber)).toEqual([
      "0",
      "0.200",
      "12.35",
      "123.5",
      "12345",
      "1.00e-7",
      "–",
    ]);
    expect(formatBytes(104_448_000)).toBe("104 MB");
    expect([0.2, 14, 200, 9000].map(formatSeconds)).toEqual(["under a second", "14 s", "3 min", "2.5 h"]);
    expect([0.2, 14].map(formatEstimatedTime)).toEqual(["under a second", "about 14 s"]);
  });

  test("are short on an axis and keep their noughts", () => {
    expect([0.0001, 0.375, 12.5, 20, 1000, 200000].map(tickLabel)).toEqual(["0.0001", "0.375", "12.5", "20", "1000", "2e5"]);
  });

  test("are read with point or comma, and only when they are numbers", () => {
    expect([" 1,5 ", "2e-3", "abc", "", "Infinity"].map(parseNumber)).toEqual([1.5, 0.002, null, null, null]);
  });
});

describe("colors", () => {
  test("the picker shows the hue of a quantity, however small, and keeps its size", () => {
    expect(toHex([0.02, 0.01, 0], 0)).toBe(toHex([1, 0.5, 0]));
    expect(fromHex("#ffffff", [0.02, 0.01, 0], 0)).toEqual([0.02, 0.02, 0.02]);
    expect(toHex([0, 0, 0], 0)).toBe("#000000");
  });

  test("the picker keeps a color's strength", () => {
    const strong: Rgb = [4, 2, 1];
    expect(peakValue(strong)).toBe(4);
    fromHex(toHex(strong), strong).forEach((v, c) => expect(v).toBeCloseTo(strong[c] as number, 1));
    expect(toHex([1, 1, 1])).toBe("#ffffff");
    expect(fromHex("#ffffff", [0.2, 0.1, 0.1])).toEqual([1, 1, 1]);
  });
});

describe("terms", () => {
  const model = (name: string, parameters: string[]): ModelBody => ({
    model: name,
    label: name,
    help: "",
    source: "",
    texture: "specular",
    needs_data: false,
    width_parameter: name === "flat" ? null : "roughness",
    width_power: name === "flat" ? null : 1,
    specular_below: null,
    data_prefix: null,
    parameters: parameters.map((p) => ({
      name: p,
      label: p,
      minimum: 0,
      maximum: 1,
      default: 0.5,
      unit: "",
      scale: "linear",
      help: "",
      step: null,
      requires_new_operator: false,
    })),
    curves: [],
  });
  const models = [model("ggx", ["roughness", "f0"]), model("schlick", ["roughness", "r"]), model("flat", [])];

  test("the map of roughness stays where the new model has a width", () => {
    const term = { ...defaultTerm(models[0] as ModelBody), roughness_map: "roughness" };
    expect(withModel(term, "schlick", models).roughness_map).toBe("roughness");
    expect(withModel(term, "flat", models)).not.toHaveProperty("roughness_map");
  });

  test("a new model keeps color, texture and parameters of the same name", () => {
    const term = {
      ...defaultTerm(models[0] as ModelBody),
      color: [1, 2, 3] as Rgb,
      params: { roughness: 0.1, f0: 0.9 },
      curves: { theta_h: {} },
    };
    expect(withModel(term, "schlick", models)).toEqual({
      model: "schlick",
      color: [1, 2, 3],
      params: { roughness: 0.1, r: 0.5 },
      texture: null,
      curves: {},
    });
    expect(withModel(term, "nothing", models)).toBe(term);
  });

  test("measured models are offered to terms that name a material, and keep it between them", () => {
    const measured = models.map((m) => ({ ...m, model: `measured_${m.model}`, needs_data: true, data_prefix: "merl:" }));
    const all = [...models, ...measured];
    const term = { model: "ggx", color: [1, 1, 1] as Rgb };
    const otherTerm = { ...term, model: "measured_ggx", data: "merl:0123456789abcdef" };
    expect(modelsFor(null, all)).toEqual(models);
    expect(modelsFor(term, all)).toEqual(models);
    expect(modelsFor(otherTerm, all)).toEqual(all);
    expect(withModel(otherTerm, "measured_ggx", all)).toHaveProperty("data", otherTerm.data);
    expect(withModel(otherTerm, "ggx", all)).not.toHaveProperty("data");
  });
});

test("a place survives the URL", () => {
  const urlState = {
    scene: "ab12",
    bake: "cd34",
    view: "front & left",
    sideBySide: [],
    material: "a/b~c",
    term: 2,
    curve: "theta_h",
    light: "Desk light",
    room: "a1",
    watch: null,
    share: null,
  };
  const read = (address: string) => {
    const url = new URL(address, "http://host");
    return parseUrl(url.search, url.hash);
  };
  expect(read(formatUrl(urlState))).toEqual(urlState);
  expect(new URL(formatUrl(urlState), "http://host").search).not.toContain("a1");
  const watched = { ...urlState, room: null, watch: "b&2" };
  expect(read(formatUrl(watched))).toEqual(watched);
  const several = { ...urlState, sideBySide: ["front & left", "a, b", "c=d"] };
  expect(read(formatUrl(several))).toEqual(several);
  expect(parseUrl("?term=-3")).toEqual({
    scene: null,
    bake: null,
    view: null,
    sideBySide: [],
    material: null,
    term: 0,
    curve: null,
    light: null,
    room: null,
    watch: null,
    share: null,
  });
  expect(parseUrl("?term=zzz").term).toBe(0);
});

test("free names are free", () => {
  expect(nextName([])).toBe("Look 1");
  expect(nextName(["Warm", "Look 3"])).toBe("Look 4");
});

test("chords name Shift only beside Ctrl", () => {
  const key = (k: string, ctrlKey = false, shiftKey = false) => formatShortcut({ key: k, ctrlKey, shiftKey, metaKey: false });
  expect([key("?", false, true), key("Z", true, true), key("z", true), key("W")]).toEqual([
    "?",
    "Ctrl+Shift+z",
    "Ctrl+z",
    "w",
  ]);
});

test("a gauge is read from Prometheus text", () => {
  const text =
    "# HELP relume_frozen_cache_bytes x\nrelume_frozen_cache_bytes 1.5e+06\nrelume_frozen_cache_bytes_limit 9\n";
  expect(parseGauge(text, "relume_frozen_cache_bytes")).toBe(1_500_000);
  expect(parseGauge(text, "nothing")).toBeNull();
});
