/** The open curve as the server last sent it, passed on at a pace that leaves the frames to the image. */
import { signal } from "@preact/signals";
import type { CurveMessage } from "../protocol";

export const curvePreview = signal<CurveMessage | null>(null);
/** An interval of the open curve whose pixels are tinted, degrees. */
export const brushedRange = signal<[from: number, to: number] | null>(null);

/** Drawing a plot in software costs as much as drawing the image. */
const MIN_INTERVAL_MS = 60;

let newestPreview: CurveMessage | null = null;
let timer = 0;
let lastTime = -Infinity;

function publishPreview(): void {
  timer = 0;
  lastTime = performance.now();
  curvePreview.value = newestPreview;
}

/** Show a curve: at once where the last change is long ago, else a little later; the newest always comes. */
export function showCurvePreview(message: CurveMessage): void {
  newestPreview = message;
  if (timer !== 0) return;
  const wait = lastTime + MIN_INTERVAL_MS - performance.now();
  if (wait <= 0) publishPreview();
  else timer = window.setTimeout(publishPreview, wait);
}

/** Another curve is open: pending previews are not of it. */
export function clearCurvePreview(): void {
  clearTimeout(timer);
  timer = 0;
  lastTime = -Infinity;
  curvePreview.value = null;
}
