import { beforeEach, describe, expect, test } from "vitest";
import { changeValue } from "../src/state/document/jsonPatch";
import { History, type PerformStep } from "../src/edit/history";
import type { Look } from "../src/protocol";
import { LOOK, lookWith } from "./exampleLook";

let value = 0;
let now = 0;
let history: History;

const EXPOSURE = "/display/exposure";
const exposed = (exposure: number): Look => lookWith(LOOK, EXPOSURE, exposure);

/** The look is a number here: its exposure. */
const perform: PerformStep = (step, back) => {
  if (step.kind === "look") value = (back ? step.before : step.after).display.exposure;
};
const goTo = (count: number) => history.goTo(count, perform);
const undo = () => goTo(history.cursor.value - 1);
const redo = () => goTo(history.cursor.value + 1);

function change(to: number, key?: string): void {
  const step = { kind: "look" as const, label: `to ${to}`, ...changeValue(exposed(value), EXPOSURE, to) };
  value = to;
  history.record(key === undefined ? step : { ...step, key });
}

beforeEach(() => {
  value = now = 0;
  history = new History(() => now);
});

describe("History", () => {
  test("undo and redo walk through every step", async () => {
    [1, 2, 3].forEach((v) => change(v));
    await undo();
    await undo();
    expect(value).toBe(1);
    await redo();
    expect(value).toBe(2);
    expect([history.canUndo, history.canRedo]).toEqual([true, true]);
  });

  test("presses while a step is being undone count too, and so do those the other way", async () => {
    [1, 2, 3].forEach((v) => change(v));
    const slow: PerformStep = async (step, back) => {
      await Promise.resolve();
      void perform(step, back);
    };
    const press = (by: number) => history.goTo(history.targetCursor + by, slow);
    const first = press(-1);
    await Promise.all([first, press(-1), press(-1)]);
    expect([value, history.cursor.value, history.targetCursor]).toEqual([0, 0, 0]);
    await Promise.all([press(1), press(1), press(-1)]);
    expect([value, history.cursor.value]).toEqual([1, 1]);
  });

  test("undone steps can be kept: nothing that comes takes them away", async () => {
    [1, 2, 3].forEach((v) => change(v));
    const saved = { name: "Look 1", look: LOOK };
    history.record({ kind: "savedLook", label: "Save Look 1", before: null, after: saved });
    await goTo(1);
    expect(history.commitUndone()).toBe(true);
    expect(history.canRedo).toBe(false);
    change(7);
    expect(history.commitUndone()).toBe(false);
    expect(history.steps.value.map((step) => step.label)).toEqual([
      "to 1",
      "to 2",
      "to 3",
      "Save Look 1",
      "Back to “to 1”",
      "Back to “to 1”",
      "to 7",
    ]);
    expect(history.steps.value[4]).toMatchObject({ kind: "savedLook", before: saved, after: null });
    await undo();
    expect(value).toBe(1);
    await undo();
    expect(value).toBe(3);
    await goTo(7);
    expect(value).toBe(7);
  });

  test("a drag is one step, back to where it began", async () => {
    change(1);
    for (let v = 10; v < 60; v++) change(v, "/sigma");
    history.endGesture();
    expect(history.steps.value).toHaveLength(2);
    expect(history.steps.value[1]).toMatchObject({
      patch: [{ op: "replace", path: EXPOSURE, value: 59 }],
      inverse: [{ op: "replace", path: EXPOSURE, value: 1 }],
    });
    await undo();
    expect(value).toBe(1);
    await redo();
    expect(value).toBe(59);
  });

  test("another gesture, another pointer or a pause begins a new step", () => {
    change(1, "/sigma");
    history.endGesture();
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
      history.extendGesture();
    }
    change(2, "/sigma");
    expect(history.steps.value).toHaveLength(1);
  });

  test("an edit after undo forgets what could be redone", async () => {
    change(1);
    change(2);
    await undo();
    change(3);
    expect(history.canRedo).toBe(false);
    await undo();
    expect(value).toBe(1);
  });

  test("an operation that fails to undo leaves the cursor where it was", async () => {
    history.record({ kind: "savedLook", label: "delete look", before: { name: "Look", look: {} }, after: null });
    await expect(history.goTo(0, () => Promise.reject(new Error("offline")))).rejects.toThrow("offline");
    expect(history.cursor.value).toBe(1);
    expect(history.canUndo).toBe(true);
  });

  test("goTo jumps over several steps, clamped", async () => {
    [1, 2, 3, 4].forEach((v) => change(v));
    await goTo(1);
    expect(value).toBe(1);
    await goTo(99);
    expect(value).toBe(4);
    await goTo(-5);
    expect(value).toBe(0);
  });

  test("its length is bounded", () => {
    for (let v = 0; v < 1000; v++) change(v);
    expect(history.steps.value.length).toBeLessThanOrEqual(200);
    expect(history.cursor.value).toBe(history.steps.value.length);
  });
});
