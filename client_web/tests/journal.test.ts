import { describe, expect, test } from "vitest";
import { changeAt } from "../src/document/change";
import { History, type Step } from "../src/edit/history";
import { fromText, toText, type Story } from "../src/edit/journal";
import type { Look } from "../src/protocol";
import { LOOK, lookWith } from "./look";

const LONG = 1 << 20;
const SIGMA = "/materials/Teapot/terms/1/params/sigma";
const EDITS: [path: string, value: unknown][] = [
  [SIGMA, 0.3],
  ["/lights/Point", { kind: "point", scale: 1, color: [1, 1, 1], on: true, emission: [1, 1, 1], position: [0, 1, 0] }],
  ["/lights/Point/position", [1, 2, 3]],
  ["/materials/a~1b~0c/terms", [LOOK.materials.Teapot?.terms[0], LOOK.materials.Teapot?.terms[1]]],
  ["/lights/Point", undefined],
];

function storyOf(edits: typeof EDITS): { story: Story; looks: Look[] } {
  const history = new History(() => 0);
  const looks = [LOOK];
  for (const [path, value] of edits) {
    const before = looks.at(-1) as Look;
    const change = changeAt(before, path, value);
    looks.push(change.after);
    history.record({ of: "look", label: path, ...change });
  }
  return { story: { steps: history.steps.value, cursor: history.cursor.value }, looks };
}

const none = () => null;
const read = (text: string, look: Look) => fromText(text, look, () => undefined);

describe("the kept history", () => {
  test("comes back step by step", () => {
    const { story, looks } = storyOf(EDITS);
    expect(read(toText(story, LONG, none), looks.at(-1) as Look)).toEqual(story);
  });

  test("keeps what can be redone, and steps of saved looks", () => {
    const { story, looks } = storyOf(EDITS.slice(0, 3));
    const saved: Step = { of: "shelf", label: "Save Look", before: null, after: { name: "Look", look: LOOK } };
    const mixed = { steps: [...story.steps.slice(0, 1), saved, ...story.steps.slice(1)], cursor: 2 };
    expect(read(toText(mixed, LONG, none), looks[1] as Look)).toEqual(mixed);
  });

  test("bridges what lies between two steps", () => {
    const { story, looks } = storyOf(EDITS);
    const without = { steps: story.steps.filter((_, i) => i !== 2), cursor: 4 };
    expect(read(toText(without, LONG, none), looks.at(-1) as Look)).toEqual(without);
  });

  test("is not taken up where it leads to another look", () => {
    const { story } = storyOf(EDITS);
    expect(read(toText(story, LONG, none), lookWith(LOOK, SIGMA, 0.9))).toBeNull();
  });

  test("forgets the oldest steps where it is too long, and what is left still undoes", () => {
    const { story, looks } = storyOf(Array.from({ length: 150 }, (_, i) => [SIGMA, i / 150]));
    const text = toText(story, 4000, none);
    const back = read(text, looks.at(-1) as Look) as Story;
    expect(text.length).toBeLessThanOrEqual(4000);
    expect(back.steps.length).toBeGreaterThan(5);
    expect(back.steps).toEqual(story.steps.slice(-back.steps.length));
    expect(back.cursor).toBe(back.steps.length);
  });

  test("keeps the done step next to now, where all was undone but one", () => {
    const { story, looks } = storyOf(Array.from({ length: 50 }, (_, i) => [SIGMA, i / 50]));
    const back = read(toText({ ...story, cursor: 1 }, 3000, none), looks[1] as Look) as Story;
    expect(back.steps).toEqual(story.steps.slice(1 - back.cursor, 1 - back.cursor + back.steps.length));
  });

  test("has the pictures of its looks", () => {
    const { story, looks } = storyOf(EDITS.slice(0, 2));
    const text = toText(story, LONG, (look) => (look === looks[1] ? null : `of ${looks.indexOf(look)}`));
    const given: [Look, string][] = [];
    fromText(text, looks[2] as Look, (look, picture) => given.push([look, picture]));
    expect(given).toEqual([
      [LOOK, "of 0"],
      [looks[2], "of 2"],
    ]);
  });
});
