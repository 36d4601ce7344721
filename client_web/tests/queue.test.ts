import { describe, expect, test } from "vitest";
import { backoffMs } from "../src/net/backoff";
import { EditQueue, MAX_PATCH_BYTES } from "../src/net/queue";
import type { Look, PatchOp } from "../src/protocol";
import { setAt } from "../src/state/pointer";
import { applyPatch } from "./apply";
import { LOOK } from "./look";

const SIGMA = "/materials/Teapot/terms/1/params/sigma";
const sigma = (value: number): Look => setAt(LOOK, SIGMA, value);

function opened(): EditQueue {
  const queue = new EditQueue();
  queue.reset(LOOK, 4);
  return queue;
}

describe("EditQueue", () => {
  test("only the newest value travels", () => {
    const queue = opened();
    for (let i = 1; i <= 100; i++) queue.want(sigma(i / 100), i);
    expect(queue.take()).toEqual([{ revision: 5, patch: [{ op: "replace", path: SIGMA, value: 1 }], inputTime: 100 }]);
    expect(queue.pending).toBe(false);
    expect(queue.take()).toEqual([]);
  });

  test("going back before anything was sent sends nothing", () => {
    const queue = opened();
    queue.want(sigma(0.5), 1);
    queue.want(LOOK, 2);
    expect(queue.take()).toEqual([]);
  });

  test("edits made without a connection go as one when it is back, and revisions never fall", () => {
    const queue = opened();
    queue.want(sigma(0.5), 1);
    queue.take();
    queue.want(sigma(0.6), 2);
    queue.reset(LOOK, 0);
    expect(queue.take()).toEqual([{ revision: 6, patch: [{ op: "replace", path: SIGMA, value: 0.6 }], inputTime: 2 }]);
  });

  test("after a refusal the last confirmed look is known and the whole look goes out", () => {
    const queue = opened();
    queue.want(sigma(0.5), 1);
    queue.take();
    queue.confirm(5);
    queue.want(sigma(99), 2);
    queue.take();
    const good = queue.refuse(6) as Look;
    expect(good).toEqual(sigma(0.5));
    queue.want(good, 3);
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
    queue.want(big, 1);
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
