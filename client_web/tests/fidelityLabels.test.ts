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
  bakedFreeCameraError.value = { delta_e: 0.93, rms: 2.27, delta_e_standard_error: 0.1, rms_standard_error: 0.2 };
  expect(labels()).toContain("Approximate while moving: difference hardly visible");
  expect(fidelityMarks()[0]?.title).toContain("ΔE 0.9; 227 % RMS error of linear radiance");
  freeCameraError.value = { delta_e: 3.4, rms: 0.217, delta_e_standard_error: null, rms_standard_error: null };
  expect(labels()).toContain("Approximate while moving: difference visible at a glance");
  expect(fidelityMarks()[0]?.title).toContain("ΔE 3.4; 22 % RMS");
  expect(fidelityMarks()[0]?.title).toContain("ΔE 0.9; 227 % RMS");
});

test("the label says that the timeline plays", () => {
  isPlaying.value = true;
  for (const rough of ["preview", "approximate", "incremental"] as const) {
    fidelity.value = rough;
    vi.advanceTimersByTime(1000);
    expect(labels()).toEqual(["Playing"]);
  }
  isPlaying.value = false;
  expect(labels()).toEqual(["Approximate"]);
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
