/** Edits, undo and redo as the server hears of them. */
import { beforeEach, expect, test, vi } from "vitest";
import type { Change } from "../src/document/change";
import { edit, onChange, replaceLook } from "../src/edit/edit";
import { hand, heldAt } from "../src/edit/hand";
import { history } from "../src/edit/history";
import { redo, undo } from "../src/looks/undo";
import { look } from "../src/state/look";
import { applyPatch } from "./apply";
import { LOOK, lookWith } from "./look";

const SIGMA = "/materials/Teapot/terms/1/params/sigma";
const EXPOSURE = "/display/exposure";

let heard: Change[];
const lastPatch = () => heard.at(-1)?.patch;

beforeEach(() => {
  vi.stubGlobal("window", {});
  heard = [];
  history.clear();
  look.value = LOOK;
  onChange((change) => heard.push(change));
});

async function press(key: () => void): Promise<void> {
  key();
  await vi.waitFor(() => expect(history.heading).toBe(history.cursor.value));
}

test("an edit says what it changed, undo and redo the same back and again", async () => {
  edit("σ", SIGMA, 0.5);
  expect(lastPatch()).toEqual([{ op: "replace", path: SIGMA, value: 0.5 }]);
  await press(undo);
  expect(lastPatch()).toEqual([{ op: "replace", path: SIGMA, value: 0.2 }]);
  expect(look.value).toBe(LOOK);
  await press(redo);
  expect(lastPatch()).toEqual([{ op: "replace", path: SIGMA, value: 0.5 }]);
});

test("an edit that changes nothing is no step, and nobody hears of it", () => {
  edit("σ", SIGMA, 0.2);
  replaceLook("Show a look", structuredClone(LOOK));
  expect(heard).toEqual([]);
  expect(history.steps.value).toEqual([]);
});

test("the way of a whole drag back is one patch", async () => {
  for (let i = 1; i <= 30; i++) edit("σ", SIGMA, i / 10);
  await press(undo);
  expect(lastPatch()).toEqual([{ op: "replace", path: SIGMA, value: 0.2 }]);
});

test("after an edit that the server refused, undo leads from the look that is there", async () => {
  edit("σ", SIGMA, 0.5);
  history.seal();
  edit("Exposure", EXPOSURE, 1);
  history.drop();
  look.value = lookWith(LOOK, EXPOSURE, 3); // what the server took last is none of the looks of the history
  await press(undo);
  expect(look.value).toBe(LOOK);
  expect(applyPatch(heard.at(-1)?.before as object, lastPatch() ?? [])).toEqual(LOOK);
  expect(lastPatch()).toEqual([{ op: "replace", path: EXPOSURE, value: 0 }]);
});

test("what the hand is on is where it edits, and nothing while it undoes", async () => {
  edit("σ", SIGMA, 0.5);
  expect(hand.value).toBe(SIGMA);
  await press(undo);
  expect(hand.value).toBeNull();
});

test("the hand is on curves, parameters, colours, lights that there are, and fields of the environment", () => {
  const lit = lookWith(LOOK, "/lights/a~1b", { kind: "point" });
  const held = (path: string) => heldAt(path, lit);
  expect(held("/materials/a~1b/terms/0/curves/theta_h")).toBe("/materials/a~1b/terms/0/curves/theta_h");
  expect(held("/materials/a~1b/terms/0/color")).toBe("/materials/a~1b/terms/0/color");
  expect(held("/materials/a~1b/terms")).toBeNull();
  expect(held("/lights/a~1b/position")).toBe("/lights/a~1b");
  expect(held("/lights/gone")).toBeNull();
  expect(held("/environment/rotation")).toBe("/environment/rotation");
  expect(held("/display/exposure")).toBeNull();
});
