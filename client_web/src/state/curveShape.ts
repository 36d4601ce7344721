/** The open curve as the server last sent it, passed on at a pace that leaves the frames to the picture. */
import { signal } from "@preact/signals";
import type { CurveMessage } from "../protocol";

export const curveShape = signal<CurveMessage | null>(null);
/** A stretch of the open curve whose pixels are tinted, degrees. */
export const brushed = signal<[from: number, to: number] | null>(null);

/** Drawing a plot in software costs as much as drawing the picture. */
const EVERY_MS = 60;

let newest: CurveMessage | null = null;
let timer = 0;
let lastTime = -Infinity;

function pass(): void {
  timer = 0;
  lastTime = performance.now();
  curveShape.value = newest;
}

/** Show a curve: at once where the last change is long ago, else a little later; the newest always comes. */
export function showShape(message: CurveMessage): void {
  newest = message;
  if (timer !== 0) return;
  const wait = lastTime + EVERY_MS - performance.now();
  if (wait <= 0) pass();
  else timer = window.setTimeout(pass, wait);
}

/** Another curve is open: what is on its way is not of it. */
export function forgetShape(): void {
  clearTimeout(timer);
  timer = 0;
  lastTime = -Infinity;
  curveShape.value = null;
}
