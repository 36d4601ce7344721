/** The timeline: looks shown in passing, keyframes as steps of the history, playing what the server says. */
import { beforeEach, expect, test, vi } from "vitest";
import type { LookChange } from "../src/state/document/jsonPatch";
import { editValue, commitPreview, cancelPreview, onLookChange, previewedStep, previewStep } from "../src/edit/edit";
import { activeControl } from "../src/edit/activeControl";
import { history } from "../src/edit/history";
import { parseHistory, serializeHistory } from "../src/edit/journal";
import {
  addKeyframe,
  cameraPathMode,
  nextKeyframeName,
  keyframes,
  isLooping,
  moveKeyframe,
  removeKeyframe,
  seconds,
  setKeyframeCamera,
} from "../src/panels/looks/keyframes";
import { redo, undo } from "../src/panels/looks/undoRedo";
import { bake } from "../src/state/bakes";
import { look } from "../src/state/look";
import { placedCameraOf } from "../src/state/cameras";
import { timelineOpen } from "../src/state/panels";
import { shownViews, activeViewName, views } from "../src/state/views";
import { playhead as place, frameLookList, numFrames, renderPath, play, isPlaying, seek, togglePlay } from "../src/panels/timeline/playback";
import { LOOK, lookWith } from "./exampleLook";

const EXPOSURE = "/display/exposure";
const exposure = () => look.value?.display.exposure;
const [DARK, BRIGHT] = [lookWith(LOOK, EXPOSURE, -2), lookWith(LOOK, EXPOSURE, 2)];

let changes: LookChange[];
let ticks: FrameRequestCallback[];

beforeEach(() => {
  ticks = [];
  vi.stubGlobal("window", { setTimeout: (run: () => void) => run() });
  vi.stubGlobal("requestAnimationFrame", (tick: FrameRequestCallback) => ticks.push(tick));
  vi.stubGlobal("cancelAnimationFrame", (id: number) => ticks.splice(id - 1, 1, () => undefined));
  changes = [];
  timelineOpen.value = false;
  bake.value = null;
  previewedStep.value = null;
  history.clear();
  keyframes.value = [];
  look.value = LOOK;
  onLookChange((change) => changes.push(change));
});

async function press(key: () => Promise<void>): Promise<void> {
  await key();
  await vi.waitFor(() => expect(history.targetCursor).toBe(history.cursor.value));
}

/** A timeline from dark to bright with the frames' looks and cameras from the server. */
async function prepared(cameras: { to_world: number[]; yfov: number }[] | null = null): Promise<void> {
  const looks = Array.from({ length: numFrames.value }, (_, k) => lookWith(LOOK, EXPOSURE, -2 + (4 * k) / (numFrames.value - 1)));
  vi.stubGlobal("fetch", () => Promise.resolve(new Response(JSON.stringify({ looks, cameras }))));
  bake.value = "b";
  timelineOpen.value = true;
  addKeyframe({ name: "Dark", look: DARK });
  addKeyframe({ name: "Bright", look: BRIGHT });
  await vi.waitFor(() => expect(frameLookList.value).not.toBeNull());
}

test("what is asked to be played while its frames are on their way is played when they are there", async () => {
  const soon = prepared();
  togglePlay();
  expect(isPlaying.value).toBe(false);
  await soon;
  expect(isPlaying.value).toBe(true);
  togglePlay();
  expect(isPlaying.value).toBe(false);
  timelineOpen.value = false;
  timelineOpen.value = true;
  togglePlay();
  togglePlay();
  await vi.waitFor(() => expect(frameLookList.value).not.toBeNull());
  expect(isPlaying.value).toBe(false);
});

test("what is shown in passing is no step, and is gone from without a trace", () => {
  previewStep("on the way", DARK);
  previewStep("on the way", BRIGHT);
  expect(exposure()).toBe(2);
  expect(history.steps.value).toEqual([]);
  cancelPreview();
  expect(look.value).toEqual(LOOK);
  expect(changes.length).toBe(3);
  cancelPreview();
  expect(changes.length).toBe(3);
});

test("kept, it is one step from what was there before", async () => {
  previewStep("on the way", DARK);
  previewStep("at 1 s", BRIGHT);
  commitPreview();
  expect(history.steps.value.map(({ label }) => label)).toEqual(["at 1 s"]);
  await press(undo);
  expect(look.value).toEqual(LOOK);
  await press(redo);
  expect(exposure()).toBe(2);
});

test("an edit keeps what it changes: undo goes back to that, then to before", async () => {
  previewStep("on the way", DARK);
  editValue("Rotation", "/environment/rotation", 45);
  expect(previewedStep.value).toBeNull();
  await press(undo);
  expect([exposure(), look.value?.environment.rotation]).toEqual([-2, 0]);
  await press(undo);
  expect(look.value).toEqual(LOOK);
});

test("undo first leaves what is shown in passing", async () => {
  editValue("Exposure", EXPOSURE, 1);
  previewStep("on the way", DARK);
  await press(undo);
  expect(look.value).toEqual(LOOK);
  await press(redo);
  expect(exposure()).toBe(1);
});

test("keyframes are put on, moved and taken off in steps that can be undone and outlive a reload", async () => {
  for (const name of ["a", "b", "c"]) addKeyframe({ name, look: LOOK });
  const names = () => keyframes.value.map(({ name }) => name).join("");
  moveKeyframe(2, -1);
  expect(names()).toBe("acb");
  moveKeyframe(0, -1);
  removeKeyframe(0);
  expect(names()).toBe("cb");
  for (const shown of ["acb", "abc", "ab"]) {
    await press(undo);
    expect(names()).toBe(shown);
  }
  const text = serializeHistory({ steps: history.steps.value, cursor: history.cursor.value }, 1 << 20, () => null);
  const stored = parseHistory(text, LOOK, () => undefined);
  expect(stored?.steps).toEqual(history.steps.value);
});

test("unnamed keyframes get different names", () => {
  addKeyframe({ name: nextKeyframeName(), look: LOOK });
  addKeyframe({ name: nextKeyframeName(), look: LOOK });
  removeKeyframe(0);
  expect(nextKeyframeName()).not.toBe(keyframes.value[0]?.name);
});

test("a place on the way shows the frame that is nearest, and closing shows what was there", async () => {
  await prepared();
  seek(0.25);
  expect(exposure()).toBeCloseTo(-1, 9);
  seek(7);
  expect([place.value, exposure()]).toEqual([1, 2]);
  timelineOpen.value = false;
  expect(look.value).toEqual(LOOK);
});

test.each([true, false])("playing goes on with the clock and %s: again from the beginning", async (again) => {
  await prepared();
  isLooping.value = again;
  seek(0);
  play();
  const start = performance.now();
  ticks.at(-1)?.(start + 250 * seconds.value);
  expect(place.value).toBeCloseTo(0.25, 1);
  ticks.at(-1)?.(start + 1100 * seconds.value);
  expect(place.value).toBeCloseTo(again ? 0.1 : 1, 1);
  expect(isPlaying.value).toBe(again);
  editValue("Rotation", "/environment/rotation", 45);
  expect(isPlaying.value).toBe(false);
});

test("a pause and a play within one frame do not play twice as fast", async () => {
  await prepared();
  seek(0);
  play();
  isPlaying.value = false;
  play();
  const now = performance.now() + 100 * seconds.value;
  for (const tick of [...ticks]) tick(now);
  expect(place.value).toBeCloseTo(0.1, 1);
  const due = ticks.filter((tick) => tick.name === "tick");
  expect(due.length).toBe(1);
});

test("the camera moves from keyframe to keyframe and stays where playback ends", async () => {
  const at = (x: number, yfov = 40) => ({ to_world: [1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, 4, 0, 0, 0, 1], yfov });
  const bounds = [[-1, -1, -1], [1, 1, 1]];
  views.value = [{ name: "front", width: 4, height: 3, camera_mode: "free", bounds, camera: at(0, 0.5) } as never];
  [shownViews.value, activeViewName.value, cameraPathMode.value] = [["front"], "front", "along"];
  const path = Array.from({ length: numFrames.value }, (_, k) => at(k));
  await prepared(path);
  setKeyframeCamera(1, at(100));
  expect(renderPath("along", 9)).toMatchObject({ cameras: [{ to_world: at(0).to_world }, at(100)] });
  expect(renderPath("around", 9)).toMatchObject({ turntable: 9, start_camera: { to_world: at(0).to_world } });
  expect(renderPath("object", 9)).toMatchObject({ rotate: "object", start_camera: { to_world: at(0).to_world } });
  expect(renderPath("still", 9)).toBeNull();
  await vi.waitFor(() => expect(frameLookList.value).not.toBeNull());
  const x = () => views.value[0]?.camera.to_world[3];
  seek(1);
  expect(x()).toBe(numFrames.value - 1);
  seek(0);
  play();
  ticks.at(-1)?.(performance.now() + 500 * seconds.value);
  expect(x()).toBeCloseTo((numFrames.value - 1) / 2, -1);
  isPlaying.value = false;
  expect(placedCameraOf("front")?.camera.to_world[3]).toBe(x());
  [views.value, activeViewName.value, cameraPathMode.value] = [[], "", "still"];
});

test("one look is enough where the environment turns, and a view that was baked from one place shows it", async () => {
  cameraPathMode.value = "environment";
  const looks = Array.from({ length: numFrames.value }, (_, k) => lookWith(LOOK, "/environment/rotation", k));
  vi.stubGlobal("fetch", () => Promise.resolve(new Response(JSON.stringify({ looks, cameras: null }))));
  bake.value = "b";
  timelineOpen.value = true;
  addKeyframe({ name: "Dark", look: LOOK });
  await vi.waitFor(() => expect(frameLookList.value).not.toBeNull());
  expect(renderPath("environment", 9)).toEqual({ turntable: 9, rotate: "environment", start_camera: null });
  seek(1);
  expect(look.value?.environment.rotation).toBe(numFrames.value - 1);
  expect(activeControl.value).toBe("/environment/rotation");
  cameraPathMode.value = "around"; // which this view cannot
  await vi.waitFor(() => expect(frameLookList.value).toBeNull());
  cameraPathMode.value = "still";
});
