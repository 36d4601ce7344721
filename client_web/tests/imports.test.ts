import { describe, expect, it } from "vitest";
import type { SceneBody } from "../src/protocol";
import { areSameOptions, DEFAULT_OPTIONS, IMPORT_OPTIONS, optionsText } from "../src/start/importOptions";
import { formatSize, sizeDoubt } from "../src/start/sceneSize";
import { isDisposable } from "../src/start/useReimport";
import { groupWarnings, namesText } from "../src/start/warningKinds";

const warning = (text: string) => ({ text, severity: "unsupported" as const, where: "" });

describe("import options", () => {
  it("have the server's defaults, and each value once", () => {
    expect(DEFAULT_OPTIONS).toEqual({
      up: "file",
      unit: "file",
      recenter: "auto",
      light_unit: "file",
      scene_name: "",
      time: null,
    });
    for (const { choices } of IMPORT_OPTIONS)
      expect(new Set(choices.map(({ value }) => value)).size).toBe(choices.length);
  });

  it("are text if they are not the defaults", () => {
    expect(optionsText(DEFAULT_OPTIONS)).toBe("");
    expect(optionsText({ ...DEFAULT_OPTIONS, up: "z", unit: "mm" })).toBe("Up axis +Z, Unit Millimeters");
    expect(optionsText({ ...DEFAULT_OPTIONS, time: 0 })).toBe("Time 0");
    expect(areSameOptions(DEFAULT_OPTIONS, { ...DEFAULT_OPTIONS })).toBe(true);
    expect(areSameOptions(DEFAULT_OPTIONS, { ...DEFAULT_OPTIONS, recenter: "never" })).toBe(false);
  });
});

describe("the size of a scene", () => {
  it("is in meters", () => {
    expect(formatSize([2.4, 0.85, 1.1])).toBe("2.40 × 0.85 × 1.10 m");
    expect(formatSize([0, 0.00123, 0.0456])).toBe("0.00 × 0.00123 × 0.0456 m");
    expect(formatSize([99.999, 1234.5, 1.24e6])).toBe("100.00 × 1,230 × 1,240,000 m");
    expect(formatSize([1e-7, 2e-7, 0])).toBe("0.0000001 × 0.0000002 × 0.00 m");
  });

  it("is doubted beyond 100 m and below 1 cm", () => {
    expect(sizeDoubt([100, 2, 3])).toBeNull();
    expect(sizeDoubt([0.01, 0, 0])).toBeNull();
    expect(sizeDoubt([3, 1000, 2])).toContain("a person would be 1/570 of its longest side");
    expect(sizeDoubt([0.009, 0.001, 0])).toContain("Smaller than 1 cm");
  });
});

describe("warnings of one kind", () => {
  const images = ["a.png", "b.png", "c.png", "d.png"].map((name) => warning(`Missing image “${name}” (map_Kd).`));

  it("are one line with their number and names", () => {
    const [kind, ...rest] = groupWarnings(images);
    expect(rest).toEqual([]);
    expect(kind?.text).toBe("Missing image “…” (map_Kd).");
    expect(kind?.warnings).toHaveLength(4);
    expect(namesText(kind?.names ?? [])).toBe("a.png, b.png, c.png and 1 more");
    expect(namesText(["a", "b", "c"])).toBe("a, b, c");
  });

  it("keep what they have in common, and prefer names to numbers", () => {
    const texts = ["Removed 12 triangles of “Cup” in “x.obj”.", "Removed 1,024 triangles of “Pan” in “x.obj”."];
    const [kind] = groupWarnings(texts.map(warning));
    expect(kind?.text).toBe("Removed … triangles of “…” in “x.obj”.");
    expect(kind?.names).toEqual(["Cup", "Pan"]);
  });

  it("stay as they are alone or equal, in their order", () => {
    const kinds = groupWarnings([warning("Skipped line 4."), ...images, warning("Other."), warning("Other.")]);
    expect(kinds.map(({ text, names, warnings }) => [text, names.length, warnings.length])).toEqual([
      ["Skipped line 4.", 0, 1],
      ["Missing image “…” (map_Kd).", 4, 4],
      ["Other.", 0, 2],
    ]);
  });
});

describe("a scene that another import option replaced", () => {
  const scene = { id: "new", bakes: [], views: [{ name: "front", aspect: 1, is_placed: false }] } as Partial<SceneBody>;
  const isGone = (change: Partial<SceneBody>, known: string[] | null = ["old"]) =>
    isDisposable({ ...scene, ...change } as SceneBody, known === null ? null : new Set(known));

  it("goes only if nobody can miss it", () => {
    expect(isGone({})).toBe(true);
    expect(isGone({ id: "old" })).toBe(false);
    expect(isGone({ bakes: ["a bake"] })).toBe(false);
    expect(isGone({ views: [{ name: "Mine", aspect: 1, is_placed: true }] })).toBe(false);
    expect(isGone({}, null)).toBe(false);
  });
});
