/** Pixel → curve: asks the server what a pixel is made of, one question at a time, the newest pixel first. */
import { effect } from "@preact/signals";
import { send } from "../live/connections";
import { isAway } from "../live/drawing";
import type { Picture } from "../picture/picture";
import { drawn } from "../state/display";
import { probe } from "../state/probe";

const EVERY_MS = 40;
const GIVE_UP_MS = 1000;
let timer = 0;
let asked = 0;

function waiting(): boolean {
  return probe.peek()?.answer === null && performance.now() - asked < GIVE_UP_MS;
}

function ask(): void {
  timer = 0;
  const at = probe.peek();
  if (at === null || isAway(at.view)) return; // the server is where the eye was: it is asked when both rest
  asked = performance.now();
  send({ type: "probe", view: at.view, x: at.x, y: at.y });
}

function schedule(): void {
  if (timer === 0) timer = window.setTimeout(ask, waiting() ? EVERY_MS * 3 : EVERY_MS);
}

/** The pointer is over this pixel; outside the picture nothing is probed. */
export function probeAt(picture: Picture, x: number, y: number): void {
  if (picture.radiance(x, y) === null) return leavePicture();
  const { view } = picture;
  const last = probe.peek();
  if (last?.view === view && last.x === x && last.y === y) return;
  // the last answer stays until the next one, so that the plot does not flicker
  probe.value = { view, x, y, answer: last?.answer ?? null };
  schedule();
}

export function leavePicture(): void {
  clearTimeout(timer);
  timer = 0;
  if (probe.peek() !== null) probe.value = null;
}

// what the pixel is made of changes with the picture
effect(() => {
  drawn.value;
  if (probe.peek() !== null && performance.now() - asked > 4 * EVERY_MS) schedule();
});
