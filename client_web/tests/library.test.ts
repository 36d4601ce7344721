import { afterEach, describe, expect, it, vi } from "vitest";
import { elsewhere, group, importMaterial, isFound, library, model, query, showAll, shown } from "../src/library/library";
import { highlightOf, placeOf, pointOf, rangeOf } from "../src/library/map";

const POINTS = [
  { f0: 0.04, sigma: 0.02 },
  { f0: 0.81, sigma: 0.5 },
  { f0: 0.25, sigma: 0.1 },
];
const RANGE = rangeOf(POINTS);

describe("the map of materials", () => {
  it("has its corners at the smoothest darkest and the roughest brightest", () => {
    expect(placeOf({ f0: 0.04, sigma: 0.02 }, RANGE)).toEqual({ x: 0, y: 0 });
    const { x, y } = placeOf({ f0: 0.81, sigma: 0.5 }, RANGE);
    expect([x, y]).toEqual([expect.closeTo(1), expect.closeTo(1)]);
  });

  it("finds the way back from any place", () => {
    for (const point of POINTS) {
      const again = pointOf(placeOf(point, RANGE), RANGE);
      expect(again.f0).toBeCloseTo(point.f0);
      expect(again.sigma).toBeCloseTo(point.sigma);
    }
  });

  it("keeps places outside on the edge", () => {
    expect(pointOf({ x: -3, y: 0 }, RANGE).f0).toBeCloseTo(0.04);
    expect(pointOf({ x: 0, y: 9 }, RANGE).sigma).toBeCloseTo(0.5);
  });
});

describe("the highlight of a material on the map", () => {
  const term = (model: string, params: object) => ({ model, color: [1, 1, 1], texture: null, params, curves: {} }) as never;

  it("is that of its Cook–Torrance term, of several channels their mean", () => {
    expect(highlightOf([])).toBeNull();
    expect(highlightOf([term("lambert", {}), term("ggx", { roughness: 0.3 })])).toBeNull();
    const { f0, sigma } = highlightOf([term("lambert", {}), term("cook_torrance", { sigma: [0.1, 0.2, 0.3], ior: 3, extinction: 0 })]) ?? {};
    expect([f0, sigma]).toEqual([expect.closeTo(0.25), expect.closeTo(0.2)]);
  });
});

describe("the search in the library", () => {
  const brass = { name: "alum-bronze", about: "alum-bronze. Cook–Torrance, Ngan 2005" };

  it("finds by any part of the words, in any order, with a blank for a hyphen", () => {
    for (const typed of ["", "bronze", "ALUM BR", "bronze alum", "ngan", "alum-bronze "]) expect(isFound(brass, typed)).toBe(true);
    for (const typed of ["brass", "bronze 2006"]) expect(isFound(brass, typed)).toBe(false);
  });
});

describe("what is found elsewhere", () => {
  const fitted = (id: string, name: string, model: string, group: string) => ({ id, name, source: "", model, group, terms: [] }) as never;

  it("is told where nothing that is shown is called so, and shown whole", () => {
    library.value = [fitted("a", "Gold", "ward", "metal"), fitted("b", "Felt", "cook_torrance", "fabric")];
    [query.value, group.value] = ["felt", "all"];
    expect(elsewhere.value).toEqual([]);
    for (const [typed, of, found] of [["gold", "all", "ward"], ["felt", "metal", "cook_torrance"]] as const) {
      [query.value, group.value] = [typed, of];
      expect(elsewhere.value).toEqual([[found, 1]]);
      showAll(found);
      expect([shown.value.length, elsewhere.value]).toEqual([1, []]);
    }
    query.value = "brass";
    expect(elsewhere.value).toEqual([]);
    query.value = "";
    model.value = "cook_torrance";
  });
});

describe("files for the library", () => {
  afterEach(() => vi.unstubAllGlobals());

  it.each([
    ["felt.zip", "/api/materials/btf-works"],
    ["carpet01_W400xH400.BTF", "/api/materials/btf-works"],
    ["gold.binary", "/api/materials/measured"],
  ])("%s goes where it is read", async (name, path) => {
    const asked: string[] = [];
    class Request {
      upload = {};
      onerror?: () => void;
      open(_method: string, to: string) {
        asked.push(to);
      }
      send() {
        this.onerror?.();
      }
    }
    vi.stubGlobal("window", globalThis);
    vi.stubGlobal("XMLHttpRequest", Request);
    await importMaterial(new File(["!"], name));
    expect(asked).toEqual([path]);
  });
});
