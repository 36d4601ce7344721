/** Latency from input to image, for the status bar and for benchmarks (`window.relumeStats`). */
import { signal } from "@preact/signals";

/** Of a recent edit; what the status bar shows. */
export const latencyMs = signal<number | null>(null);

export interface Latency {
  revision: number;
  /** Both on the clock of performance.now, milliseconds. */
  inputTime: number;
  drawnTime: number;
}

const MAX_RECORDS = 1000;
/** The number on the status bar changes at most this often: painting it must not cost frames. */
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

/** This browser has drawn an image itself. */
export function recordClientFrame(): void {
  stats.drawnHere += 1;
}

export function recordEditSent(revision: number, inputTime: number): void {
  waiting.push({ revision, inputTime: Math.max(inputTime, connectedTime) });
  if (waiting.length > MAX_RECORDS) waiting.shift();
}

/** What was sent is no measure: another session counts its revisions anew, or nothing came for a while. What is sent from
 * now on counts from now, however long it waited for a connection. */
export function clearPendingEdits(): void {
  waiting.length = 0;
  connectedTime = performance.now();
}

/** These revisions are drawn, nobody saw when. */
export function dropShownEdits(revision: number): void {
  while (waiting[0] !== undefined && waiting[0].revision <= revision) waiting.shift();
}

let shownTime = -Infinity;

function publishLatency(ms: number, now: number): void {
  if (now - shownTime < SHOW_EVERY_MS) return;
  shownTime = now;
  latencyMs.value = ms;
}

/** A frame of this revision is on the focused view's canvas. */
export function recordFrameShown(revision: number): void {
  const drawnTime = performance.now();
  while (waiting[0] !== undefined && waiting[0].revision <= revision) {
    const { revision: sent, inputTime } = waiting.shift() as { revision: number; inputTime: number };
    latencies.push({ revision: sent, inputTime, drawnTime });
    if (latencies.length > MAX_RECORDS) latencies.shift();
    if (waiting[0] === undefined || waiting[0].revision > revision) publishLatency(drawnTime - inputTime, drawnTime);
  }
}
