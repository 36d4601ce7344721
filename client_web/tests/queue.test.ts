import { describe, expect, test } from "vitest";
import { changeAt, type Change } from "../src/document/change";
import { backoffMs } from "../src/net/backoff";
import { EditQueue, MAX_PATCH_BYTES } from "../src/net/editQueue";
import type { Look, PatchOp } from "../src/protocol";
import { applyPatch } from "./apply";
import { LOOK, lookWith } from "./look";

const SIGMA = "/materials/Teapot/terms/1/params/sigma";
const sigma = (value: number): Look => lookWith(LOOK, SIGMA, value);

const wanted = (look: Look, inputTime: number, hand: string | null = null) => ({ look, hand, solo: null, inputTime });

function opened(): EditQueue {
  const queue = new EditQueue();
  queue.reset(LOOK, 4);
  return queue;
}

describe("EditQueue", () => {
  test("only the newest value travels", () => {
    const queue = opened();
    for (let i = 1; i <= 100; i++) queue.want(wanted(sigma(i / 100), i));
    expect(queue.take()).toEqual([{ revision: 5, patch: [{ op: "replace", path: SIGMA, value: 1 }], hand: null, solo: null, inputTime: 100 }]);
    expect(queue.pending).toBe(false);
    expect(queue.take()).toEqual([]);
  });

  test("edits travel as what they changed, many as one patch", () => {
    const queue = opened();
    let look = LOOK;
    const edit = (path: string, value: unknown) => {
      const change: Change = changeAt(look, path, value);
      look = change.after;
      queue.want(wanted(look, 1), change);
    };
    queue.want(wanted(LOOK, 0));
    const light = { kind: "point", scale: 1, color: [1, 1, 1], on: true, emission: [1, 1, 1], position: [0, 1, 0] };
    edit("/lights/Point", light);
    for (let i = 1; i <= 50; i++) edit("/lights/Point/position", [i, 1, 0]);
    for (let i = 1; i <= 50; i++) edit(SIGMA, i / 100);
    const [first] = queue.take();
    expect(first?.patch).toHaveLength(2);
    expect(first?.patch).toContainEqual({ op: "add", path: "/lights/Point", value: { ...light, position: [50, 1, 0] } });
    expect(first?.patch).toContainEqual({ op: "replace", path: SIGMA, value: 0.5 });
    edit("/lights/Point", undefined);
    expect(queue.take()).toEqual([{ revision: 6, patch: [{ op: "remove", path: "/lights/Point" }], hand: null, solo: null, inputTime: 1 }]);
    queue.reset(LOOK, 6);
    edit("/display/exposure", 2);
    expect(applyPatch(LOOK, queue.take()[0]?.patch ?? [])).toEqual(look);
  });

  test("an edit says what the hand was on last", () => {
    const queue = opened();
    queue.want(wanted(sigma(0.3), 1, SIGMA));
    queue.want(wanted(lookWith(sigma(0.3), "/lights/Sun", { kind: "directional" }), 2, "/lights/Sun"));
    expect(queue.take()).toMatchObject([{ hand: "/lights/Sun", inputTime: 2 }]);
  });

  test("another source of light that is alone goes by itself, and as long as it is alone with every edit", () => {
    const queue = opened();
    const alone = (look: Look, solo: string[] | null) => queue.want({ ...wanted(look, 1), solo });
    alone(LOOK, ["Sun"]);
    expect(queue.take()).toMatchObject([{ revision: 5, patch: [], solo: ["Sun"] }]);
    alone(LOOK, ["Sun"]);
    expect(queue.pending).toBe(false);
    alone(sigma(0.3), ["Sun"]);
    expect(queue.take()).toMatchObject([{ patch: [{ path: SIGMA }], solo: ["Sun"] }]);
    alone(sigma(0.3), null);
    expect(queue.take()).toMatchObject([{ patch: [], solo: null }]);
    queue.reset(sigma(0.3), 9, ["Sun"]);
    expect(queue.take()).toMatchObject([{ patch: [], solo: null }]);
  });

  test("going back before anything was sent sends nothing", () => {
    const queue = opened();
    queue.want(wanted(sigma(0.5), 1));
    queue.want(wanted(LOOK, 2));
    expect(queue.take()).toEqual([]);
  });

  test("edits made without a connection go as one when it is back, and revisions never fall", () => {
    const queue = opened();
    queue.want(wanted(sigma(0.5), 1));
    queue.take();
    queue.want(wanted(sigma(0.6), 2));
    queue.reset(LOOK, 0);
    expect(queue.take()).toEqual([{ revision: 6, patch: [{ op: "replace", path: SIGMA, value: 0.6 }], hand: null, solo: null, inputTime: 2 }]);
  });

  test("after a refusal the last confirmed look is known and the whole look goes out", () => {
    const queue = opened();
    queue.want(wanted(sigma(0.5), 1));
    queue.take();
    queue.confirm(5);
    queue.want(wanted(sigma(99), 2));
    queue.take();
    const good = queue.refuse(6) as Look;
    expect(good).toEqual(sigma(0.5));
    queue.want(wanted(good, 3));
    expect(queue.take()[0]?.patch).toEqual([{ op: "replace", path: "", value: good }]);
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
    queue.want(wanted(big, 1));
    const edits = queue.take();
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
