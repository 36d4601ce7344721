/** What is said of a free-camera image: how far it is off, where it rested last or as its bake was measured. */
import { beforeEach, expect, test, vi } from "vitest";
import { method } from "../src/state/bakes";
import { bakedFreeCameraError, fidelity, isOutdated, freeCameraError, isConverged } from "../src/state/fidelity";
import { shownViews, activeViewName, views } from "../src/state/views";
import { isPlaying } from "../src/panels/timeline/playback";
import { fidelityMarks } from "../src/viewport/fidelityLabels";

beforeEach(() => {
  vi.useFakeTimers();
  shownViews.value = ["front"];
  views.value = [{ name: "front", camera_mode: "free" } as never];
  activeViewName.value = "front";
  fidelity.value = "exact";
  fidelity.value = "approximate";
  vi.advanceTimersByTime(1000);
});

const labels = () => fidelityMarks().map((mark) => mark.label);

test("before the first camera stop, the error is the one measured in the bake", () => {
  [bakedFreeCameraError.value, freeCameraError.value] = [null, null];
  expect(labels()).toContain("Approximate while moving");
  bakedFreeCameraError.value = { value: 0.0312, standard_error: 0.0021 };
  expect(labels()).toContain("Approximate while moving (about 3.1 % error)");
  expect(fidelityMarks()[0]?.title).toContain("3.1 ± 0.2 %");
  freeCameraError.value = 0.217;
  expect(labels()).toContain("Approximate while moving (about 22 % error)");
  expect(fidelityMarks()[0]?.title).toContain("3.1 ± 0.2 %");
});

test("the label says that the timeline plays", () => {
  isPlaying.value = true;
  for (const rough of ["preview", "approximate", "incremental"] as const) {
    fidelity.value = rough;
    vi.advanceTimersByTime(1000);
    expect(labels()).toEqual(["Playing"]);
  }
  isPlaying.value = false;
  expect(labels()).toEqual(["Approximate while dragging"]);
});

test("a direct light bake is labeled even if its image is exact", () => {
  fidelity.value = "exact";
  isConverged.value = true;
  method.value = "direct";
  expect(labels()).toEqual(["Direct light only"]);
  expect(fidelityMarks()[0]?.title).toContain("No bounce light");
  method.value = "gather";
  expect(labels()).toEqual([]);
});

test("an image older than the newest edit is labeled until a newer one is shown", () => {
  fidelity.value = "exact";
  [isConverged.value, isConverged.value] = [false, true];
  views.value = [{ name: "front", camera_mode: "fixed" } as never];
  isOutdated.value = true;
  vi.advanceTimersByTime(200);
  expect(labels()).toEqual([]); // nothing flickers during a drag
  vi.advanceTimersByTime(200);
  expect(labels()).toEqual(["Updating…"]);
  fidelity.value = "preview";
  isOutdated.value = false;
  expect(labels()).toEqual(["Preview"]);
});
