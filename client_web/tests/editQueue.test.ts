import { describe, expect, test } from "vitest";
import { changeValue, type LookChange } from "../src/state/document/jsonPatch";
import { backoffMs } from "../src/session/net/backoff";
import { EditQueue, MAX_PATCH_BYTES } from "../src/session/net/editQueue";
import type { Look, PatchOp } from "../src/protocol";
import { applyPatch } from "./applyPatch";
import { LOOK, lookWith } from "./exampleLook";

const SIGMA = "/materials/Teapot/terms/1/params/sigma";
const sigma = (value: number): Look => lookWith(LOOK, SIGMA, value);

const targetOf = (look: Look, inputTime: number, activeControl: string | null = null) => ({
  look,
  activeControl,
  solo: null,
  inputTime,
});

function opened(): EditQueue {
  const queue = new EditQueue();
  queue.reset(LOOK, 4);
  return queue;
}

describe("EditQueue", () => {
  test("only the newest value travels", () => {
    const queue = opened();
    for (let i = 1; i <= 100; i++) queue.setTarget(targetOf(sigma(i / 100), i));
    expect(queue.takeEdits()).toEqual([
      {
        revision: 5,
        patch: [{ op: "replace", path: SIGMA, value: 1 }],
        activeControl: null,
        solo: null,
        inputTime: 100,
      },
    ]);
    expect(queue.hasPending).toBe(false);
    expect(queue.takeEdits()).toEqual([]);
  });

  test("edits travel as what they changed, many as one patch", () => {
    const queue = opened();
    let look = LOOK;
    const edit = (path: string, value: unknown) => {
      const change: LookChange = changeValue(look, path, value);
      look = change.after;
      queue.setTarget(targetOf(look, 1), change);
    };
    queue.setTarget(targetOf(LOOK, 0));
    const light = {
      kind: "point",
      intensity: 1,
      color: [1, 1, 1],
      enabled: true,
      emission: [1, 1, 1],
      position: [0, 1, 0],
    };
    edit("/lights/Point", light);
    for (let i = 1; i <= 50; i++) edit("/lights/Point/position", [i, 1, 0]);
    for (let i = 1; i <= 50; i++) edit(SIGMA, i / 100);
    const [first] = queue.takeEdits();
    expect(first?.patch).toHaveLength(2);
    expect(first?.patch).toContainEqual({
      op: "add",
      path: "/lights/Point",
      value: { ...light, position: [50, 1, 0] },
    });
    expect(first?.patch).toContainEqual({ op: "replace", path: SIGMA, value: 0.5 });
    edit("/lights/Point", undefined);
    expect(queue.takeEdits()).toEqual([
      { revision: 6, patch: [{ op: "remove", path: "/lights/Point" }], activeControl: null, solo: null, inputTime: 1 },
    ]);
    queue.reset(LOOK, 6);
    edit("/display/exposure", 2);
    expect(applyPatch(LOOK, queue.takeEdits()[0]?.patch ?? [])).toEqual(look);
  });

  test("an edit says what the hand was on last", () => {
    const queue = opened();
    queue.setTarget(targetOf(sigma(0.3), 1, SIGMA));
    queue.setTarget(targetOf(lookWith(sigma(0.3), "/lights/Sun", { kind: "directional" }), 2, "/lights/Sun"));
    expect(queue.takeEdits()).toMatchObject([{ activeControl: "/lights/Sun", inputTime: 2 }]);
  });

  test("another source of light that is alone goes by itself, and as long as it is alone with every edit", () => {
    const queue = opened();
    const alone = (look: Look, solo: string[] | null) => queue.setTarget({ ...targetOf(look, 1), solo });
    alone(LOOK, ["Sun"]);
    expect(queue.takeEdits()).toMatchObject([{ revision: 5, patch: [], solo: ["Sun"] }]);
    alone(LOOK, ["Sun"]);
    expect(queue.hasPending).toBe(false);
    alone(sigma(0.3), ["Sun"]);
    expect(queue.takeEdits()).toMatchObject([{ patch: [{ path: SIGMA }], solo: ["Sun"] }]);
    alone(sigma(0.3), null);
    expect(queue.takeEdits()).toMatchObject([{ patch: [], solo: null }]);
    queue.reset(sigma(0.3), 9, ["Sun"]);
    expect(queue.takeEdits()).toMatchObject([{ patch: [], solo: null }]);
  });

  test("going back before anything was sent sends nothing", () => {
    const queue = opened();
    queue.setTarget(targetOf(sigma(0.5), 1));
    queue.setTarget(targetOf(LOOK, 2));
    expect(queue.takeEdits()).toEqual([]);
  });

  test("edits made without a connection go as one when it is back, and revisions never fall", () => {
    const queue = opened();
    queue.setTarget(targetOf(sigma(0.5), 1));
    queue.takeEdits();
    queue.setTarget(targetOf(sigma(0.6), 2));
    queue.reset(LOOK, 0);
    expect(queue.takeEdits()).toEqual([
      {
        revision: 6,
        patch: [{ op: "replace", path: SIGMA, value: 0.6 }],
        activeControl: null,
        solo: null,
        inputTime: 2,
      },
    ]);
  });

  test("after a refusal the last confirmed look is known and the whole look goes out", () => {
    const queue = opened();
    queue.setTarget(targetOf(sigma(0.5), 1));
    queue.takeEdits();
    queue.confirmRevision(5);
    queue.setTarget(targetOf(sigma(99), 2));
    queue.takeEdits();
    const good = queue.rejectRevision(6) as Look;
    expect(good).toEqual(sigma(0.5));
    queue.setTarget(targetOf(good, 3));
    expect(queue.takeEdits()[0]?.patch).toEqual([{ op: "replace", path: "", value: good }]);
  });

  test("a look too long for one message goes in parts that make the same look", () => {
    const points = Array.from({ length: 60 }, (_, i) => [i * 1.5, i / 7]);
    const materials = Object.fromEntries(
      Array.from({ length: 90 }, (_, i) => [
        `m${i}`,
        { terms: [{ model: "ggx", color: [1, 1, 1], curves: { theta_h: { points } } }] },
      ]),
    );
    const big = { ...LOOK, materials } as unknown as Look;
    const queue = new EditQueue();
    queue.reset(null);
    queue.setTarget(targetOf(big, 1));
    const edits = queue.takeEdits();
    expect(edits.length).toBeGreaterThan(1);
    const start = {
      ...LOOK,
      materials: Object.fromEntries(Object.keys(materials).map((name) => [name, { terms: [] }])),
    };
    let look: unknown = start;
    edits.forEach(({ patch, revision }, i) => {
      expect(revision).toBe(i + 1);
      expect(JSON.stringify(patch).length).toBeLessThanOrEqual(MAX_PATCH_BYTES);
      look = applyPatch(look, patch as PatchOp[]);
    });
    expect(look).toEqual(big);
  });
});

test("backoff doubles, is bounded, and jitters", () => {
  expect([0, 1, 2, 3].map((n) => backoffMs(n, () => 0.5))).toEqual([250, 500, 1000, 2000]);
  expect(backoffMs(1000, () => 1)).toBeLessThan(10_000);
  expect(backoffMs(3, () => 0)).toBeLessThan(backoffMs(3, () => 1));
});
