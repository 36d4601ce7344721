import { afterEach, describe, expect, it, vi } from "vitest";
import {
  applyImported,
  otherGroupMatches,
  group,
  importMaterial,
  matchesSearch,
  library,
  model,
  query,
  showGroup,
  visibleEntries,
} from "../src/panels/library/libraryItems";
import { look } from "../src/state/look";
import { highlightOf, positionOf, highlightAt, mapRange } from "../src/panels/library/navigationMap";

const POINTS = [
  { f0: 0.04, sigma: 0.02 },
  { f0: 0.81, sigma: 0.5 },
  { f0: 0.25, sigma: 0.1 },
];
const RANGE = mapRange(POINTS);

describe("the map of materials", () => {
  it("has its corners at the smoothest darkest and the roughest brightest", () => {
    expect(positionOf({ f0: 0.04, sigma: 0.02 }, RANGE)).toEqual({ x: 0, y: 0 });
    const { x, y } = positionOf({ f0: 0.81, sigma: 0.5 }, RANGE);
    expect([x, y]).toEqual([expect.closeTo(1), expect.closeTo(1)]);
  });

  it("finds the way back from any place", () => {
    for (const point of POINTS) {
      const again = highlightAt(positionOf(point, RANGE), RANGE);
      expect(again.f0).toBeCloseTo(point.f0);
      expect(again.sigma).toBeCloseTo(point.sigma);
    }
  });

  it("keeps places outside on the edge", () => {
    expect(highlightAt({ x: -3, y: 0 }, RANGE).f0).toBeCloseTo(0.04);
    expect(highlightAt({ x: 0, y: 9 }, RANGE).sigma).toBeCloseTo(0.5);
  });
});

describe("the highlight of a material on the map", () => {
  const term = (model: string, params: object) =>
    ({ model, color: [1, 1, 1], texture: null, params, curves: {} }) as never;

  it("is that of its Cook–Torrance term, of several channels their mean", () => {
    expect(highlightOf([])).toBeNull();
    expect(highlightOf([term("lambert", {}), term("ggx", { roughness: 0.3 })])).toBeNull();
    const { f0, sigma } =
      highlightOf([term("lambert", {}), term("cook_torrance", { sigma: [0.1, 0.2, 0.3], ior: 3, extinction: 0 })]) ??
      {};
    expect([f0, sigma]).toEqual([expect.closeTo(0.25), expect.closeTo(0.2)]);
  });
});

describe("the search in the library", () => {
  const brass = { name: "alum-bronze", description: "alum-bronze. Cook–Torrance, Ngan 2005" };

  it("finds by any part of the words, in any order, with a blank for a hyphen", () => {
    for (const typed of ["", "bronze", "ALUM BR", "bronze alum", "ngan", "alum-bronze "])
      expect(matchesSearch(brass, typed)).toBe(true);
    for (const typed of ["brass", "bronze 2006"]) expect(matchesSearch(brass, typed)).toBe(false);
  });
});

describe("what is found elsewhere", () => {
  const fitted = (id: string, name: string, model: string, group: string) =>
    ({ id, name, source: "", model, group, terms: [] }) as never;

  it("is offered if no listed entry matches", () => {
    library.value = [fitted("a", "Gold", "ward", "metal"), fitted("b", "Felt", "cook_torrance", "fabric")];
    [query.value, group.value] = ["felt", "all"];
    expect(otherGroupMatches.value).toEqual([]);
    for (const [typed, groupName, model] of [
      ["gold", "all", "ward"],
      ["felt", "metal", "cook_torrance"],
    ] as const) {
      [query.value, group.value] = [typed, groupName];
      expect(otherGroupMatches.value).toEqual([[model, 1]]);
      showGroup(model);
      expect([visibleEntries.value.length, otherGroupMatches.value]).toEqual([1, []]);
    }
    query.value = "brass";
    expect(otherGroupMatches.value).toEqual([]);
    query.value = "";
    model.value = "cook_torrance";
  });
});

describe("an imported material", () => {
  afterEach(() => vi.unstubAllGlobals());
  const terms = [{ model: "lambert", color: [1, 1, 1], texture: "image:0123456789abcdef", params: {}, curves: {} }];
  const glass = { color: [1, 0, 0], absorption: [1, 2, 3], roughness: 0.5, ior: 1.3 };
  const imported = { name: "Oak", terms, normal_map: { image: "image:1", scale: 2 }, glass, thumbnail: "" } as never;
  const thin = { color: [1, 1, 1], roughness: 0, ior: 1.5 };

  it("brings its textures and its normal map, and its glass to objects of glass", () => {
    const materials = {
      Table: { terms: [], normal_map: null, shadow_catcher: false },
      Pane: { terms: [], glass: thin },
      Vase: { terms: [], glass: { ...thin, absorption: [0, 0, 0] } },
    };
    vi.stubGlobal("window", globalThis);
    look.value = { materials } as never;
    for (const target of Object.keys(materials)) applyImported(target, imported);
    const normals = { terms, normal_map: { image: "image:1", scale: 2 } };
    expect(look.value).toEqual({
      materials: {
        Table: { ...normals, shadow_catcher: false },
        Pane: { ...normals, glass: { color: [1, 0, 0], roughness: 0.5, ior: 1.3 } },
        Vase: { ...normals, glass },
      },
    });
    look.value = null;
  });
});

describe("files for the library", () => {
  afterEach(() => vi.unstubAllGlobals());

  it.each([
    ["felt.zip", "./api/materials/btf/jobs"],
    ["carpet01_W400xH400.BTF", "./api/materials/btf/jobs"],
    ["gold.binary", "./api/materials/measured"],
    ["gold.mtlx", "./api/materials/imported"],
    ["gold.zip", "./api/materials/imported", "…Gold.MTLX…"],
  ])("%s goes where it is read", async (name, path, content = "!") => {
    const requests: string[] = [];
    class Request {
      upload = {};
      onerror?: () => void;
      open(_method: string, to: string) {
        requests.push(to);
      }
      send() {
        this.onerror?.();
      }
    }
    vi.stubGlobal("window", globalThis);
    vi.stubGlobal("XMLHttpRequest", Request);
    await importMaterial(new File([content], name));
    expect(requests).toEqual([path]);
  });
});
