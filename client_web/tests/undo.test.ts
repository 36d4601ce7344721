/** Edits, undo and redo as the server hears of them. */
import { beforeEach, expect, test, vi } from "vitest";
import type { LookChange } from "../src/state/document/jsonPatch";
import { editValue, onLookChange, replaceLook } from "../src/edit/edit";
import { activeControl, activePath } from "../src/edit/activeControl";
import { history } from "../src/edit/history";
import { redo, undo } from "../src/panels/looks/undoRedo";
import { look } from "../src/state/look";
import { applyPatch } from "./applyPatch";
import { LOOK, lookWith } from "./exampleLook";

const SIGMA = "/materials/Teapot/terms/1/params/sigma";
const EXPOSURE = "/display/exposure";

let changes: LookChange[];
const lastPatch = () => changes.at(-1)?.patch;

beforeEach(() => {
  vi.stubGlobal("window", {});
  changes = [];
  history.clear();
  look.value = LOOK;
  onLookChange((change) => changes.push(change));
});

async function press(key: () => Promise<void>): Promise<void> {
  await key();
  await vi.waitFor(() => expect(history.targetCursor).toBe(history.cursor.value));
}

test("an edit says what it changed, undo and redo the same back and again", async () => {
  editValue("σ", SIGMA, 0.5);
  expect(lastPatch()).toEqual([{ op: "replace", path: SIGMA, value: 0.5 }]);
  await press(undo);
  expect(lastPatch()).toEqual([{ op: "replace", path: SIGMA, value: 0.2 }]);
  expect(look.value).toBe(LOOK);
  await press(redo);
  expect(lastPatch()).toEqual([{ op: "replace", path: SIGMA, value: 0.5 }]);
});

test("an edit that changes nothing is no step, and nobody hears of it", () => {
  editValue("σ", SIGMA, 0.2);
  replaceLook("Show a look", structuredClone(LOOK));
  expect(changes).toEqual([]);
  expect(history.steps.value).toEqual([]);
});

test("the way of a whole drag back is one patch", async () => {
  for (let i = 1; i <= 30; i++) editValue("σ", SIGMA, i / 10);
  await press(undo);
  expect(lastPatch()).toEqual([{ op: "replace", path: SIGMA, value: 0.2 }]);
});

test("after an edit that the server refused, undo leads from the look that is there", async () => {
  editValue("σ", SIGMA, 0.5);
  history.endGesture();
  editValue("Exposure", EXPOSURE, 1);
  history.dropLastStep();
  look.value = lookWith(LOOK, EXPOSURE, 3); // what the server took last is none of the looks of the history
  await press(undo);
  expect(look.value).toBe(LOOK);
  expect(applyPatch(changes.at(-1)?.before as object, lastPatch() ?? [])).toEqual(LOOK);
  expect(lastPatch()).toEqual([{ op: "replace", path: EXPOSURE, value: 0 }]);
});

test("what the hand is on is where it edits, and nothing while it undoes", async () => {
  editValue("σ", SIGMA, 0.5);
  expect(activeControl.value).toBe(SIGMA);
  await press(undo);
  expect(activeControl.value).toBeNull();
});

test("the hand is on curves, parameters, colors, lights that there are, and fields of the environment", () => {
  const lit = lookWith(LOOK, "/lights/a~1b", { kind: "point" });
  const held = (path: string) => activePath(path, lit);
  expect(held("/materials/a~1b/terms/0/curves/theta_h")).toBe("/materials/a~1b/terms/0/curves/theta_h");
  expect(held("/materials/a~1b/terms/0/color")).toBe("/materials/a~1b/terms/0/color");
  expect(held("/materials/a~1b/terms")).toBeNull();
  expect(held("/lights/a~1b/position")).toBe("/lights/a~1b");
  expect(held("/lights/gone")).toBeNull();
  expect(held("/environment/rotation")).toBe("/environment/rotation");
  expect(held("/display/exposure")).toBeNull();
});
