/** The status bar while a free camera stops: one text after the other, without flicker. */
import { beforeEach, expect, test, vi } from "vitest";
import { imageStatusText } from "../src/app/imageStatus";
import { isCameraMoving } from "../src/state/cameras";
import { connection, freezeStatus } from "../src/state/connection";
import { isFrameExact } from "../src/state/fidelity";
import { look } from "../src/state/look";

const APPROXIMATE = "Approximate while the camera moves";
const stage = (label: string) => ({ state: "shading" as const, view: "front", label, progress: 0.5 });

beforeEach(() => {
  vi.useFakeTimers();
  isCameraMoving.value = true;
  look.value = { materials: {}, environment: { map: "" } } as never;
  connection.value = "open";
  freezeStatus.value = null;
  isFrameExact.value = false;
  vi.advanceTimersByTime(1000);
});

test("between the stages of an exact image nothing else is said", () => {
  expect(imageStatusText.value).toBe(APPROXIMATE);
  const texts: string[] = [];
  const stop = imageStatusText.subscribe((text) => void texts.push(text));
  freezeStatus.value = stage("exact direct light");
  freezeStatus.value = null;
  vi.advanceTimersByTime(100);
  freezeStatus.value = stage("the exact image of this camera");
  freezeStatus.value = null;
  vi.advanceTimersByTime(50); // until the exact frame is there
  isFrameExact.value = true;
  vi.advanceTimersByTime(1000);
  stop();
  expect(texts.slice(1, 3)).toEqual(["Updating exact direct light…", "Updating the exact image of this camera…"]);
  expect(texts.slice(3)).toEqual([expect.stringMatching(/^Exact/)]);
});

test("a moving camera is said at once after an exact image, and soon after a canceled stage", () => {
  isFrameExact.value = true;
  vi.advanceTimersByTime(1000);
  expect(imageStatusText.value).toMatch(/^Exact/);
  isFrameExact.value = false;
  expect(imageStatusText.value).toBe(APPROXIMATE);
  freezeStatus.value = stage("the exact image of this camera");
  freezeStatus.value = null;
  vi.advanceTimersByTime(500);
  expect(imageStatusText.value).toBe(APPROXIMATE);
});
