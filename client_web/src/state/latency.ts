/** Latency from input to image, for the status bar and for benchmarks (`window.relumeStats`). */
import { signal } from "@preact/signals";

/** Latency of a recent edit, for the status bar. */
export const latencyMs = signal<number | null>(null);

export interface Latency {
  revision: number;
  /** Milliseconds on the clock of performance.now. */
  inputTime: number;
  drawnTime: number;
}

const MAX_RECORDS = 1000;
/** Minimum interval between updates of the status bar: painting must not cost frames. */
const SHOW_EVERY_MS = 250;
let connectedTime = -Infinity;
const waiting: { revision: number; inputTime: number }[] = [];
const latencies: Latency[] = [];

declare global {
  interface Window {
    relumeStats: { latencies: Latency[]; waiting: readonly { revision: number }[]; drawnHere: number };
  }
}
const stats = { latencies, waiting, drawnHere: 0 };
if (typeof window !== "undefined") window.relumeStats = stats;

/** Record an image drawn by this browser. */
export function recordClientFrame(): void {
  stats.drawnHere += 1;
}

export function recordEditSent(revision: number, inputTime: number): void {
  waiting.push({ revision, inputTime: Math.max(inputTime, connectedTime) });
  if (waiting.length > MAX_RECORDS) waiting.shift();
}

/** Discard sent revisions: a new session restarts the count, or nothing was received for a while. Later ones are measured from
 * now on, even if they waited for a connection. */
export function clearPendingEdits(): void {
  waiting.length = 0;
  connectedTime = performance.now();
}

/** Discard revisions that were drawn at an unknown time. */
export function dropShownEdits(revision: number): void {
  while (waiting[0] !== undefined && waiting[0].revision <= revision) waiting.shift();
}

let shownTime = -Infinity;

function publishLatency(ms: number, now: number): void {
  if (now - shownTime < SHOW_EVERY_MS) return;
  shownTime = now;
  latencyMs.value = ms;
}

/** A frame of this revision is on the active view's canvas. */
export function recordFrameShown(revision: number): void {
  const drawnTime = performance.now();
  let newest: number | null = null;
  while (waiting[0] !== undefined && waiting[0].revision <= revision) {
    const { revision: sent, inputTime } = waiting.shift() as { revision: number; inputTime: number };
    newest = inputTime;
    latencies.push({ revision: sent, inputTime, drawnTime });
    if (latencies.length > MAX_RECORDS) latencies.shift();
  }
  if (newest !== null) publishLatency(drawnTime - newest, drawnTime);
}
