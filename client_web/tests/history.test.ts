import { beforeEach, describe, expect, test } from "vitest";
import { History } from "../src/state/history";

let value = 0;
let now = 0;
let history: History;

function change(to: number, key?: string): void {
  const from = value;
  value = to;
  const operation = { label: `to ${to}`, redo: () => void (value = to), undo: () => void (value = from) };
  history.record(key === undefined ? operation : { ...operation, key });
}

beforeEach(() => {
  value = now = 0;
  history = new History(() => now);
});

describe("History", () => {
  test("undo and redo walk through every step", async () => {
    [1, 2, 3].forEach((v) => change(v));
    await history.undo();
    await history.undo();
    expect(value).toBe(1);
    await history.redo();
    expect(value).toBe(2);
    expect([history.canUndo, history.canRedo]).toEqual([true, true]);
  });

  test("a drag is one step, back to where it began", async () => {
    change(1);
    for (let v = 10; v < 60; v++) change(v, "/sigma");
    history.seal();
    expect(history.steps.value).toHaveLength(2);
    await history.undo();
    expect(value).toBe(1);
    await history.redo();
    expect(value).toBe(59);
  });

  test("another gesture, another pointer or a pause begins a new step", () => {
    change(1, "/sigma");
    history.seal();
    change(2, "/sigma");
    change(3, "/ior");
    now += 5000;
    change(4, "/ior");
    expect(history.steps.value).toHaveLength(4);
  });

  test("a drag held still stays one step", () => {
    change(1, "/sigma");
    for (let i = 0; i < 10; i++) {
      now += 700;
      history.hold();
    }
    change(2, "/sigma");
    expect(history.steps.value).toHaveLength(1);
  });

  test("an edit after undo forgets what could be redone", async () => {
    change(1);
    change(2);
    await history.undo();
    change(3);
    expect(history.canRedo).toBe(false);
    await history.undo();
    expect(value).toBe(1);
  });

  test("an operation that fails to undo leaves the cursor where it was", async () => {
    history.record({ label: "delete look", redo: () => undefined, undo: () => Promise.reject(new Error("offline")) });
    await expect(history.undo()).rejects.toThrow("offline");
    expect(history.cursor.value).toBe(1);
    expect(history.canUndo).toBe(true);
  });

  test("goTo jumps over several steps, clamped", async () => {
    [1, 2, 3, 4].forEach((v) => change(v));
    await history.goTo(1);
    expect(value).toBe(1);
    await history.goTo(99);
    expect(value).toBe(4);
    await history.goTo(-5);
    expect(value).toBe(0);
  });

  test("its length is bounded", () => {
    for (let v = 0; v < 1000; v++) change(v);
    expect(history.steps.value.length).toBeLessThanOrEqual(200);
    expect(history.cursor.value).toBe(history.steps.value.length);
  });
});
