/** The open curve as last sent by the server, throttled so that plotting does not slow down the image. */
import { signal } from "@preact/signals";
import type { CurveMessage } from "../protocol";

export const curvePreview = signal<CurveMessage | null>(null);
/** An interval of the open curve whose pixels are tinted, degrees. */
export const brushedRange = signal<[from: number, to: number] | null>(null);

/** Minimum interval between plots: in software, a plot costs as much as the image. */
const MIN_INTERVAL_MS = 60;

let newestPreview: CurveMessage | null = null;
let timer = 0;
let lastTime = -Infinity;

function publishPreview(): void {
  timer = 0;
  lastTime = performance.now();
  curvePreview.value = newestPreview;
}

/** Show a curve: immediately if the last change is old enough, else delayed; the newest is always shown. */
export function showCurvePreview(message: CurveMessage): void {
  newestPreview = message;
  if (timer !== 0) return;
  const wait = lastTime + MIN_INTERVAL_MS - performance.now();
  if (wait <= 0) publishPreview();
  else timer = window.setTimeout(publishPreview, wait);
}

/** Another curve was opened: drop pending previews. */
export function clearCurvePreview(): void {
  clearTimeout(timer);
  timer = 0;
  lastTime = -Infinity;
  curvePreview.value = null;
}
