/** Timeline playback: the server computes the look of each frame, as for rendering, and the frames are previewed. */
import { computed, effect, signal } from "@preact/signals";
import { freeCameraOf } from "../../viewport/cameras/freeCamera";
import type { CameraPose } from "../../viewport/cameras/orbit";
import { commitPreview, cancelPreview, previewedStep, previewStep } from "../../edit/edit";
import { interpolateLooks } from "../../session/net/api";
import type { Look, LooksBody, LooksRequest, RenderRequest } from "../../protocol";
import { bake } from "../../state/bakes";
import { timelineOpen } from "../../state/panels";
import { activeViewName } from "../../state/views";
import { reportErrors, showNote } from "../../ui/toasts";
import { crossingText } from "../looks/exportImage";
import {
  durations,
  interpolation,
  fewestKeyframes,
  keyframes,
  isLooping,
  seconds,
  currentPath,
  type CameraPathMode,
} from "../looks/keyframes";

export const FPS = 25;
const REQUEST_DELAY_MS = 120; // after the last change of the timeline

/** Position of the playhead: 0 at the first look, 1 at the last. */
export const playhead = signal(0);
export const isPlaying = signal(false);
/** The look of each frame; null while missing or loading. */
export const frameLookList = signal<readonly Look[] | null>(null);
/** Camera of each frame; null with a fixed camera. */
const frameCameras = signal<LooksBody["cameras"]>(null);
export const numFrames = computed(() => Math.max(2, Math.round(seconds.value * FPS) + 1));

const previewLabel = (fraction: number) => `Timeline at ${(fraction * seconds.peek()).toFixed(1)} s`;

/** The motion over `num` frames; null without one. */
export function renderPath(motion: CameraPathMode, num: number): NonNullable<RenderRequest["path"]> | null {
  const freeCamera = freeCameraOf(activeViewName.peek());
  if (motion === "environment") return { turntable: num, rotate: motion, start_camera: freeCamera?.pose ?? null };
  if (freeCamera === null || motion === "still") return null;
  const cameras = keyframes.peek().map((key): CameraPose => key.camera ?? freeCamera.first);
  if (motion === "along") return { cameras: cameras };
  return {
    turntable: num,
    rotate: motion === "object" ? motion : "camera",
    start_camera: cameras[0] ?? freeCamera.first,
  };
}

function showPlayhead(): void {
  const looks = frameLookList.peek();
  if (looks === null) return;
  const index = Math.round(playhead.peek() * (looks.length - 1));
  const [frameLook, camera] = [looks[index], frameCameras.peek()?.[index]];
  if (frameLook !== undefined) previewStep(previewLabel(playhead.peek()), frameLook);
  const freeCamera = freeCameraOf(activeViewName.peek());
  if (camera !== undefined) freeCamera?.play(camera);
  if (!isPlaying.peek()) freeCamera?.stop();
}

/** Move the playhead and stop. */
export function seek(fraction: number): void {
  playhead.value = Math.min(1, Math.max(0, fraction));
  showPlayhead();
}

let [previousTime, animationFrame] = [0, 0];

/** Handle of the only playback loop: pausing and playing within one frame must not start a second. */
function scheduleTick(): void {
  cancelAnimationFrame(animationFrame);
  animationFrame = requestAnimationFrame(tick);
}

function tick(now: number): void {
  if (!isPlaying.peek()) return;
  const step = (now - previousTime) / (1000 * seconds.peek());
  previousTime = now;
  const next = playhead.peek() + step;
  const ends = next >= 1 && !isLooping.peek();
  if (ends) isPlaying.value = false;
  seek(ends ? 1 : next % 1);
  scheduleTick();
}

let isPlayRequested = false; // play was pressed while the frames were loading

export function play(): void {
  isPlayRequested = frameLookList.peek() === null;
  if (isPlayRequested) return;
  if (playhead.peek() >= 1) playhead.value = 0;
  showPlayhead();
  isPlaying.value = true;
  previousTime = performance.now();
  scheduleTick();
}

export function togglePlay(): void {
  if (isPlaying.peek()) isPlaying.value = false;
  else if (isPlayRequested) isPlayRequested = false;
  else play();
}

/** Make the previewed look the edited one. */
export function commitShownLook(): void {
  isPlaying.value = false;
  commitPreview();
}

// closing the timeline restores the look
effect(() => {
  if (!timelineOpen.value) cancelPreview();
});

// an edit or an undo ends the playback
effect(() => {
  if (previewedStep.value === null) isPlaying.value = false;
});

// at the end of playback, the camera stops
effect(() => {
  if (!isPlaying.value) freeCameraOf(activeViewName.peek())?.stop();
});

let lastCrossing: string | null = null;

/** Tell once that the camera's path passes through a surface. */
function noteCrossing(material: string | null): void {
  if (material !== null && material !== lastCrossing) showNote(crossingText(material));
  lastCrossing = material;
}

let newestRequest = 0;
effect(() => {
  const [id, looks] = [bake.value, keyframes.value.map(({ look }) => look)];
  const body = {
    frames: Math.max(numFrames.value, looks.length),
    durations: durations.value,
    interpolation: interpolation.value,
    view: activeViewName.value,
  } satisfies Partial<LooksRequest>;
  const motion = currentPath.value;
  const requestNumber = ++newestRequest;
  frameLookList.value = null;
  if (!timelineOpen.value || id === null || looks.length < fewestKeyframes.value) {
    isPlaying.value = isPlayRequested = false;
    return;
  }
  window.setTimeout(() => {
    if (requestNumber !== newestRequest) return;
    void reportErrors(async () => {
      const path = renderPath(motion, body.frames);
      const answer = await interpolateLooks({ bake: id, looks: looks.map((look) => ({ ...look })), path, ...body });
      if (requestNumber !== newestRequest) return;
      frameCameras.value = motion === "environment" ? null : answer.cameras; // the user may move the camera during an environment rotation
      noteCrossing(answer.crosses);
      frameLookList.value = answer.looks as unknown as Look[];
      if (isPlayRequested) play();
      else if (previewedStep.peek() !== null) showPlayhead();
    });
  }, REQUEST_DELAY_MS);
});
