/** Playing the time line: the server says what each frame shows, as it would render it, and frames are shown in passing. */
import { computed, effect, signal } from "@preact/signals";
import { eyeOf } from "../cameras/eye";
import type { Frame } from "../cameras/orbit";
import { keepPassing, leavePassing, passing, showPassing } from "../edit/edit";
import { frameLooks } from "../net/api";
import type { Look, LooksBody, RenderRequest } from "../protocol";
import { bake } from "../state/bakes";
import { timelineOpen } from "../state/panels";
import { viewName } from "../state/views";
import { attempt } from "../ui/toasts";
import { between, fewestKeyframes, keyframes, loops, seconds, wayNow, type EyeWay } from "../looks/keyframes";

export const FPS = 25;
const ASK_MS = 120; // after the last change of the time line

/** Where the time line is: 0 the first look, 1 the last. */
export const at = signal(0);
export const playing = signal(false);
/** The look of each frame; null while there are none, or they are on their way. */
export const frames = signal<readonly Look[] | null>(null);
/** From where each frame is seen; null where the eye stays. */
const cameras = signal<LooksBody["cameras"]>(null);
export const numFrames = computed(() => Math.max(2, Math.round(seconds.value * FPS) + 1));

const words = (share: number) => `The time line at ${(share * seconds.peek()).toFixed(1)} s`;

/** What goes where while `num` frames are shown; null where nothing does. */
export function pathOf(way: EyeWay, num: number): NonNullable<RenderRequest["path"]> | null {
  const eye = eyeOf(viewName.peek());
  if (way === "environment") return { turntable: num, turns: way, start: eye?.frame ?? null };
  if (eye === null || way === "still") return null;
  const eyes = keyframes.peek().map((key): Frame => key.eye ?? eye.first);
  if (way === "along") return { eyes };
  return { turntable: num, turns: way === "object" ? way : "eye", start: eyes[0] ?? eye.first };
}

function show(): void {
  const looks = frames.peek();
  if (looks === null) return;
  const index = Math.round(at.peek() * (looks.length - 1));
  const [shown, camera] = [looks[index], cameras.peek()?.[index]];
  if (shown !== undefined) showPassing(words(at.peek()), shown);
  const eye = eyeOf(viewName.peek());
  if (camera !== undefined) eye?.pass(camera);
  if (!playing.peek()) eye?.rest();
}

/** Go to a place; it stays there. */
export function seek(share: number): void {
  at.value = Math.min(1, Math.max(0, share));
  show();
}

let [before, loop] = [0, 0];

/** One loop at most: a pause and a play within one frame begin no second. */
function goOn(): void {
  cancelAnimationFrame(loop);
  loop = requestAnimationFrame(tick);
}

function tick(now: number): void {
  if (!playing.peek()) return;
  const step = (now - before) / (1000 * seconds.peek());
  before = now;
  const next = at.peek() + step;
  const ends = next >= 1 && !loops.peek();
  if (ends) playing.value = false;
  seek(ends ? 1 : next % 1);
  goOn();
}

let isAwaited = false; // somebody has asked to play what is on its way

export function play(): void {
  isAwaited = frames.peek() === null;
  if (isAwaited) return;
  if (at.peek() >= 1) at.value = 0;
  show();
  playing.value = true;
  before = performance.now();
  goOn();
}

export function togglePlay(): void {
  if (playing.peek()) playing.value = false;
  else if (isAwaited) isAwaited = false;
  else play();
}

/** What is shown becomes the look that is edited. */
export function keepShown(): void {
  playing.value = false;
  keepPassing();
}

// with the time line closed the look is as it was
effect(() => {
  if (!timelineOpen.value) leavePassing();
});

// an edit or an undo ends the playing: what is shown is the user's again
effect(() => {
  if (passing.value === null) playing.value = false;
});

// where the playing ends, the eye has come to rest
effect(() => {
  if (!playing.value) eyeOf(viewName.peek())?.rest();
});

let newest = 0;
effect(() => {
  const [id, looks] = [bake.value, keyframes.value.map(({ look }) => look)];
  const body = { frames: Math.max(numFrames.value, looks.length), between: between.value, view: viewName.value };
  const way = wayNow.value;
  const asked = ++newest;
  frames.value = null;
  if (!timelineOpen.value || id === null || looks.length < fewestKeyframes.value) {
    playing.value = isAwaited = false;
    return;
  }
  window.setTimeout(() => {
    if (asked !== newest) return;
    void attempt(async () => {
      const path = pathOf(way, body.frames);
      const found = await frameLooks({ bake: id, looks: looks.map((look) => ({ ...look })), path, ...body });
      if (asked !== newest) return;
      cameras.value = way === "environment" ? null : found.cameras; // hands may move an eye that stays
      frames.value = found.looks as unknown as Look[];
      if (isAwaited) play();
      else if (passing.peek() !== null) show();
    });
  }, ASK_MS);
});
