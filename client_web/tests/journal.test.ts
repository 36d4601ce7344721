import { describe, expect, test } from "vitest";
import { changeValue } from "../src/state/document/jsonPatch";
import { History, type Step } from "../src/edit/history";
import { parseHistory, serializeHistory, type HistorySnapshot } from "../src/edit/journal";
import type { Look } from "../src/protocol";
import { LOOK, lookWith } from "./exampleLook";

const LONG = 1 << 20;
const SIGMA = "/materials/Teapot/terms/1/params/sigma";
const EDITS: [path: string, value: unknown][] = [
  [SIGMA, 0.3],
  [
    "/lights/Point",
    { kind: "point", intensity: 1, color: [1, 1, 1], enabled: true, emission: [1, 1, 1], position: [0, 1, 0] },
  ],
  ["/lights/Point/position", [1, 2, 3]],
  ["/materials/a~1b~0c/terms", [LOOK.materials.Teapot?.terms[0], LOOK.materials.Teapot?.terms[1]]],
  ["/lights/Point", undefined],
];

function historyOf(edits: typeof EDITS): { snapshot: HistorySnapshot; looks: Look[] } {
  const history = new History(() => 0);
  const looks = [LOOK];
  for (const [path, value] of edits) {
    const before = looks.at(-1) as Look;
    const change = changeValue(before, path, value);
    looks.push(change.after);
    history.record({ kind: "look", label: path, ...change });
  }
  return { snapshot: { steps: history.steps.value, cursor: history.cursor.value }, looks };
}

const none = () => null;
const read = (text: string, look: Look) => parseHistory(text, look, () => undefined);

describe("the kept history", () => {
  test("comes back step by step", () => {
    const { snapshot, looks } = historyOf(EDITS);
    expect(read(serializeHistory(snapshot, LONG, none), looks.at(-1) as Look)).toEqual(snapshot);
  });

  test("keeps what can be redone, and steps of saved looks", () => {
    const { snapshot, looks } = historyOf(EDITS.slice(0, 3));
    const saved: Step = { kind: "savedLook", label: "Save Look", before: null, after: { name: "Look", look: LOOK } };
    const mixed = { steps: [...snapshot.steps.slice(0, 1), saved, ...snapshot.steps.slice(1)], cursor: 2 };
    expect(read(serializeHistory(mixed, LONG, none), looks[1] as Look)).toEqual(mixed);
  });

  test("bridges what lies between two steps", () => {
    const { snapshot, looks } = historyOf(EDITS);
    const without = { steps: snapshot.steps.filter((_, i) => i !== 2), cursor: 4 };
    expect(read(serializeHistory(without, LONG, none), looks.at(-1) as Look)).toEqual(without);
  });

  test("is not taken up where it leads to another look", () => {
    const { snapshot } = historyOf(EDITS);
    expect(read(serializeHistory(snapshot, LONG, none), lookWith(LOOK, SIGMA, 0.9))).toBeNull();
  });

  test("forgets the oldest steps where it is too long, and what is left still undoes", () => {
    const { snapshot, looks } = historyOf(Array.from({ length: 150 }, (_, i) => [SIGMA, i / 150]));
    const text = serializeHistory(snapshot, 4000, none);
    const back = read(text, looks.at(-1) as Look) as HistorySnapshot;
    expect(text.length).toBeLessThanOrEqual(4000);
    expect(back.steps.length).toBeGreaterThan(5);
    expect(back.steps).toEqual(snapshot.steps.slice(-back.steps.length));
    expect(back.cursor).toBe(back.steps.length);
  });

  test("keeps the done step next to now, where all was undone but one", () => {
    const { snapshot, looks } = historyOf(Array.from({ length: 50 }, (_, i) => [SIGMA, i / 50]));
    const back = read(serializeHistory({ ...snapshot, cursor: 1 }, 3000, none), looks[1] as Look) as HistorySnapshot;
    expect(back.steps).toEqual(snapshot.steps.slice(1 - back.cursor, 1 - back.cursor + back.steps.length));
  });

  test("has the pictures of its looks", () => {
    const { snapshot, looks } = historyOf(EDITS.slice(0, 2));
    const text = serializeHistory(snapshot, LONG, (look) => (look === looks[1] ? null : `of ${looks.indexOf(look)}`));
    const given: [Look, string][] = [];
    parseHistory(text, looks[2] as Look, (look, thumbnail) => given.push([look, thumbnail]));
    expect(given).toEqual([
      [LOOK, "of 0"],
      [looks[2], "of 2"],
    ]);
  });
});
