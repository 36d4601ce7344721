import { describe, expect, test } from "vitest";
import { changeValue, changeByPatch, changeToLook, joinChanges } from "../src/state/document/jsonPatch";
import { diffLooks, isDeepEqual } from "../src/state/document/difference";
import { getAt, jsonPointer } from "../src/state/document/pointer";
import { applyPatch } from "./applyPatch";
import { LOOK, lookWith } from "./exampleLook";

const SIGMA = "/materials/Teapot/terms/1/params/sigma";
const CURVE = "/materials/Teapot/terms/1/curves/theta_h";

describe("pointers", () => {
  test("escape slashes and tildes of names", () => {
    const path = jsonPointer("materials", "a/b~c", "terms", 0, "color");
    expect(path).toBe("/materials/a~1b~0c/terms/0/color");
    expect(getAt(LOOK, path)).toEqual([0.5, 0.5, 0.5]);
  });

  test("reading never reaches the prototype", () => {
    expect(getAt(LOOK, "/materials/__proto__")).toBeUndefined();
    expect(getAt(LOOK, "/materials/constructor")).toBeUndefined();
  });
});

const POINTS = {
  points: [
    [0, 4],
    [90, 0],
  ],
};
const MORE_POINTS = {
  points: [
    [0, 4],
    [12, 1],
    [90, 0],
  ],
};
const EDITS: [path: string, value: unknown][] = [
  [SIGMA, [0.1, 0.2, 0.3]],
  ["/materials/Teapot/terms/0/model", "ggx"],
  ["/materials/a~1b~0c/terms/0/params", { roughness: 0.3 }],
  ["/materials/a~1b~0c/terms/0/curves/d", POINTS],
  [CURVE, [{ ...POINTS, channels: "r" }]],
  [CURVE, MORE_POINTS],
  ["/lights/A~1B", { kind: "point", position: [0, 1, 0] }],
  ["/lights/A~1B/position", [1, 1, 1]],
  ["/lights/A~1B", undefined],
  ["/lights/prototype", { kind: "point", position: [0, 1, 0] }],
  ["/lights/prototype/position", [1, 1, 1]],
  ["/materials/Teapot/terms", LOOK.materials.Teapot?.terms.slice(0, 1)],
  ["/display/exposure", -1.5],
];

describe("a change", () => {
  test("of one value is one operation; it shares what did not change and leaves the original alone", () => {
    const { before, after, patch, inverse } = changeValue(LOOK, SIGMA, 0.3);
    expect(patch).toEqual([{ op: "replace", path: SIGMA, value: 0.3 }]);
    expect(inverse).toEqual([{ op: "replace", path: SIGMA, value: 0.2 }]);
    expect([getAt(before, SIGMA), getAt(after, SIGMA)]).toEqual([0.2, 0.3]);
    expect(after.environment).toBe(LOOK.environment);
    expect(after.materials["a/b~c"]).toBe(LOOK.materials["a/b~c"]);
  });

  test("of a curve adds it, replaces it whole, and removes it", () => {
    const drawn = changeValue(LOOK, CURVE, POINTS);
    expect(drawn.patch).toEqual([{ op: "add", path: CURVE, value: POINTS }]);
    expect(drawn.inverse).toEqual([{ op: "remove", path: CURVE }]);
    expect(changeValue(drawn.after, CURVE, MORE_POINTS).patch).toEqual([
      { op: "replace", path: CURVE, value: MORE_POINTS },
    ]);
    const removed = changeValue(drawn.after, CURVE, undefined);
    expect(removed.patch).toEqual([{ op: "remove", path: CURVE }]);
    expect(removed.after).toEqual(LOOK);
  });

  test("to what is there already is none", () => {
    expect(changeValue(LOOK, "/environment/color", [1, 1, 1]).patch).toEqual([]);
    expect(changeValue(LOOK, "/environment", { rotation: 0, intensity: 1, color: [1, 1, 1], map: null }).patch).toEqual(
      [],
    );
    expect(changeValue(LOOK, CURVE, undefined).patch).toEqual([]);
    expect(changeValue(LOOK, CURVE, undefined).after).toBe(LOOK);
  });

  test("has patches that a server can apply, there and back", () => {
    let look = LOOK;
    for (const [path, value] of EDITS) {
      const { after, patch, inverse } = changeValue(look, path, value);
      expect(getAt(after, path)).toEqual(value);
      expect(applyPatch(look, patch)).toEqual(after);
      expect(applyPatch(after, inverse)).toEqual(look);
      expect(changeByPatch(look, patch)).toEqual({ before: look, after, patch, inverse });
      look = after;
    }
  });

  test("after a change is one with it, whatever they change", () => {
    let all = changeValue(LOOK, SIGMA, 0.25);
    for (const [path, value] of EDITS) {
      all = joinChanges(all, changeValue(all.after, path, value));
      expect(applyPatch(LOOK, all.patch)).toEqual(all.after);
      expect(applyPatch(all.after, all.inverse)).toEqual(LOOK);
    }
  });

  test("of one place, made often, stays one operation", () => {
    let all = changeValue(LOOK, CURVE, POINTS);
    for (let i = 0; i < 20; i++)
      all = joinChanges(
        all,
        changeValue(all.after, CURVE, {
          points: [
            [0, i],
            [90, 0],
          ],
        }),
      );
    expect(all.patch).toEqual([
      {
        op: "add",
        path: CURVE,
        value: {
          points: [
            [0, 19],
            [90, 0],
          ],
        },
      },
    ]);
    expect(all.inverse).toEqual([{ op: "remove", path: CURVE }]);
  });
});

describe("the difference of two looks", () => {
  test("is what there is between them, and no more", () => {
    expect(diffLooks(LOOK, lookWith(LOOK, SIGMA, 0.31))).toEqual([{ op: "replace", path: SIGMA, value: 0.31 }]);
    expect(diffLooks(LOOK, structuredClone(LOOK))).toEqual([]);
    expect(isDeepEqual(LOOK, structuredClone(LOOK))).toBe(true);
    expect(isDeepEqual(LOOK, lookWith(LOOK, SIGMA, 0.31))).toBe(false);
  });

  test("keeps a drawn curve in one piece", () => {
    const [first, second] = [lookWith(LOOK, CURVE, POINTS), lookWith(LOOK, CURVE, MORE_POINTS)];
    expect(diffLooks(first, second)).toEqual([{ op: "replace", path: CURVE, value: MORE_POINTS }]);
  });

  test("replaces the list where the number of terms is another", () => {
    const next = lookWith(LOOK, "/materials/Teapot/terms", LOOK.materials.Teapot?.terms.slice(0, 1));
    expect(diffLooks(LOOK, next)).toHaveLength(1);
  });

  test("leads from any look to any other", () => {
    let look = LOOK;
    for (const [path, value] of EDITS) {
      const next = lookWith(look, path, value);
      expect(applyPatch(look, diffLooks(look, next))).toEqual(next);
      expect(applyPatch(LOOK, diffLooks(LOOK, next))).toEqual(next);
      expect(applyPatch(next, diffLooks(next, LOOK))).toEqual(LOOK);
      expect(changeToLook(LOOK, next).after).toBe(next);
      expect(applyPatch(next, changeToLook(LOOK, next).inverse)).toEqual(LOOK);
      look = next;
    }
  });
});
