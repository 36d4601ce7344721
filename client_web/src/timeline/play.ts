/** Playing the time line: the server says what each frame shows, as it would render it, and frames are shown in passing. */
import { computed, effect, signal } from "@preact/signals";
import { eyeOf } from "../cameras/eye";
import { turned } from "../cameras/orbit";
import { keepPassing, leavePassing, passing, showPassing } from "../edit/edit";
import { frameLooks } from "../net/api";
import type { Look } from "../protocol";
import { bake } from "../state/bakes";
import { timelineOpen } from "../state/panels";
import { viewName } from "../state/views";
import { attempt } from "../ui/toasts";
import { between, keyframes, loops, seconds, turns } from "../looks/keyframes";

export const FPS = 25;
const ASK_MS = 120; // after the last change of the time line

/** Where the time line is: 0 the first look, 1 the last. */
export const at = signal(0);
export const playing = signal(false);
/** The look of each frame; null while there are none, or they are on their way. */
export const frames = signal<readonly Look[] | null>(null);
export const numFrames = computed(() => Math.max(2, Math.round(seconds.value * FPS) + 1));

const words = (share: number) => `The time line at ${(share * seconds.peek()).toFixed(1)} s`;

function show(): void {
  const looks = frames.peek();
  const shown = looks?.[Math.round(at.peek() * (looks.length - 1))];
  if (shown !== undefined) showPassing(words(at.peek()), shown);
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
  if (turns.peek()) eyeOf(viewName.peek())?.change((orbit) => turned(orbit, 2 * Math.PI * step, 0));
  goOn();
}

export function play(): void {
  if (frames.peek() === null) return;
  if (at.peek() >= 1) at.value = 0;
  show();
  playing.value = true;
  before = performance.now();
  goOn();
}

export function togglePlay(): void {
  if (playing.peek()) playing.value = false;
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

let newest = 0;
effect(() => {
  const [id, looks] = [bake.value, keyframes.value.map(({ look }) => look)];
  const body = { frames: Math.max(numFrames.value, looks.length), between: between.value };
  const asked = ++newest;
  frames.value = null;
  if (!timelineOpen.value || id === null || looks.length < 2) {
    playing.value = false;
    return;
  }
  window.setTimeout(() => {
    if (asked !== newest) return;
    void attempt(async () => {
      const found = await frameLooks({ bake: id, looks: looks.map((look) => ({ ...look })), ...body });
      if (asked !== newest) return;
      frames.value = found;
      if (passing.peek() !== null) show();
    });
  }, ASK_MS);
});
