/** What is said of a moving picture: how far it is off, where it rested last or as its bake was measured. */
import { beforeEach, expect, test, vi } from "vitest";
import { method } from "../src/state/bakes";
import { bakedError, fidelity, isOutdated, movingError, settled } from "../src/state/fidelity";
import { shownViews, viewName, views } from "../src/state/views";
import { playing } from "../src/timeline/play";
import { marks } from "../src/viewport/fidelityMarks";

beforeEach(() => {
  vi.useFakeTimers();
  shownViews.value = ["front"];
  views.value = [{ name: "front", eye: "free" } as never];
  viewName.value = "front";
  fidelity.value = "exact";
  fidelity.value = "approximate";
  vi.advanceTimersByTime(1000);
});

const words = () => marks().map((mark) => mark.words);

test("until the eye has rested it is what the bake has measured, with its standard error", () => {
  [bakedError.value, movingError.value] = [null, null];
  expect(words()).toContain("Moving view, approximate");
  bakedError.value = { value: 0.0312, standard_error: 0.0021 };
  expect(words()).toContain("Moving view, about 3.1 % off");
  expect(marks()[0]?.title).toContain("3.1 ± 0.2 %");
  movingError.value = 0.217;
  expect(words()).toContain("Moving view, about 22 % off");
  expect(marks()[0]?.title).toContain("3.1 ± 0.2 %");
});

test("while a time line plays it is said to play, whichever way its frames come", () => {
  playing.value = true;
  for (const rough of ["preview", "approximate", "followed"] as const) {
    fidelity.value = rough;
    vi.advanceTimersByTime(1000);
    expect(words()).toEqual(["Playing"]);
  }
  playing.value = false;
  expect(words()).toEqual(["Followed closely"]);
});

test("a bake of direct light says that objects are not reflected, also where its picture is exact", () => {
  fidelity.value = "exact";
  settled.value = true;
  method.value = "direct";
  expect(words()).toEqual(["Direct light only"]);
  expect(marks()[0]?.title).toContain("Objects are not reflected");
  method.value = "gather";
  expect(words()).toEqual([]);
});

test("a picture of before the newest edit says so until one of after it is there", () => {
  fidelity.value = "exact";
  [settled.value, settled.value] = [false, true];
  views.value = [{ name: "front", eye: "baked" } as never];
  isOutdated.value = true;
  vi.advanceTimersByTime(200);
  expect(words()).toEqual([]); // nothing flickers under a hand
  vi.advanceTimersByTime(200);
  expect(words()).toEqual(["Updating…"]);
  fidelity.value = "preview";
  isOutdated.value = false;
  expect(words()).toEqual(["Preview"]);
});
