import { describe, expect, test } from "vitest";
import { diffLooks } from "../src/state/diff";
import { getAt, pointer, setAt } from "../src/state/pointer";
import { applyPatch } from "./apply";
import { LOOK } from "./look";

const SIGMA = "/materials/Teapot/terms/1/params/sigma";
const CURVE = "/materials/Teapot/terms/1/curves/theta_h";

describe("pointers", () => {
  test("escape slashes and tildes of names", () => {
    const path = pointer("materials", "a/b~c", "terms", 0, "color");
    expect(path).toBe("/materials/a~1b~0c/terms/0/color");
    expect(getAt(LOOK, path)).toEqual([0.5, 0.5, 0.5]);
  });

  test("setting shares what did not change and leaves the original alone", () => {
    const next = setAt(LOOK, SIGMA, 0.3);
    expect(getAt(next, SIGMA)).toBe(0.3);
    expect(getAt(LOOK, SIGMA)).toBe(0.2);
    expect(next.environment).toBe(LOOK.environment);
    expect(next.materials["a/b~c"]).toBe(LOOK.materials["a/b~c"]);
  });

  test("setting undefined removes the member", () => {
    const drawn = setAt(LOOK, CURVE, {
      points: [
        [0, 1],
        [90, 0],
      ],
    });
    expect(setAt(drawn, CURVE, undefined)).toEqual(LOOK);
  });

  test("reading never reaches the prototype", () => {
    expect(getAt(LOOK, "/materials/__proto__")).toBeUndefined();
    expect(getAt(LOOK, "/materials/constructor")).toBeUndefined();
  });
});

describe("diffLooks", () => {
  test("one value is one replace", () => {
    expect(diffLooks(LOOK, setAt(LOOK, SIGMA, 0.31))).toEqual([{ op: "replace", path: SIGMA, value: 0.31 }]);
  });

  test("a curve is added, then replaced whole, then removed", () => {
    const first = setAt(LOOK, CURVE, {
      points: [
        [0, 4],
        [90, 0],
      ],
    });
    const second = setAt(first, CURVE, {
      points: [
        [0, 4],
        [12, 1],
        [90, 0],
      ],
    });
    expect(diffLooks(LOOK, first).map(({ op, path }) => [op, path])).toEqual([["add", CURVE]]);
    expect(diffLooks(first, second).map(({ op, path }) => [op, path])).toEqual([["replace", CURVE]]);
    expect(diffLooks(second, LOOK)).toEqual([{ op: "remove", path: CURVE }]);
  });

  test("another number of terms replaces the list", () => {
    const next = setAt(LOOK, "/materials/Teapot/terms", LOOK.materials.Teapot?.terms.slice(0, 1));
    expect(diffLooks(LOOK, next)).toHaveLength(1);
    expect(applyPatch(LOOK, diffLooks(LOOK, next))).toEqual(next);
  });

  test("equal looks of other objects need nothing", () => {
    expect(diffLooks(LOOK, structuredClone(LOOK))).toEqual([]);
  });

  test("an unknown server state gets the whole look", () => {
    expect(diffLooks(null, LOOK)).toEqual([{ op: "replace", path: "", value: LOOK }]);
  });

  test("applied, the patch gives the wanted look, whatever was edited", () => {
    const edits: [string, unknown][] = [
      [SIGMA, [0.1, 0.2, 0.3]],
      ["/materials/Teapot/terms/0/model", "ggx"],
      ["/materials/a~1b~0c/terms/0/params", { roughness: 0.3 }],
      [
        CURVE,
        [
          {
            points: [
              [0, 1],
              [90, 0],
            ],
            channels: "r",
          },
        ],
      ],
      ["/display/exposure", -1.5],
    ];
    let look = LOOK;
    for (const [path, value] of edits) {
      const next = setAt(look, path, value);
      expect(applyPatch(look, diffLooks(look, next))).toEqual(next);
      expect(applyPatch(LOOK, diffLooks(LOOK, next))).toEqual(next);
      expect(applyPatch(next, diffLooks(next, LOOK))).toEqual(LOOK);
      look = next;
    }
  });
});
