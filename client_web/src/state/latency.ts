/** How long it takes from the hand to the picture, for the status bar and for benchmarks (`window.relumeStats`). */
import { signal } from "@preact/signals";

/** Of a recent edit; what the status bar shows. */
export const latencyMs = signal<number | null>(null);

export interface Latency {
  revision: number;
  /** Both on the clock of performance.now, milliseconds. */
  inputTime: number;
  drawnTime: number;
}

const MAX_KEPT = 1000;
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

/** This browser has drawn a picture itself. */
export function noteDrawnHere(): void {
  stats.drawnHere += 1;
}

export function editSent(revision: number, inputTime: number): void {
  waiting.push({ revision, inputTime: Math.max(inputTime, connectedTime) });
  if (waiting.length > MAX_KEPT) waiting.shift();
}

/** What was sent is no measure: another session counts its revisions anew, or nothing came for a while. What is sent from
 * now on counts from now, however long it waited for a connection. */
export function forgetWaiting(): void {
  waiting.length = 0;
  connectedTime = performance.now();
}

/** These revisions are drawn, nobody saw when. */
export function forgetDrawn(revision: number): void {
  while (waiting[0] !== undefined && waiting[0].revision <= revision) waiting.shift();
}

let shownTime = -Infinity;

function show(ms: number, now: number): void {
  if (now - shownTime < SHOW_EVERY_MS) return;
  shownTime = now;
  latencyMs.value = ms;
}

/** A frame of this revision is on the focused view's canvas. */
export function frameDrawn(revision: number): void {
  const drawnTime = performance.now();
  while (waiting[0] !== undefined && waiting[0].revision <= revision) {
    const { revision: sent, inputTime } = waiting.shift() as { revision: number; inputTime: number };
    latencies.push({ revision: sent, inputTime, drawnTime });
    if (latencies.length > MAX_KEPT) latencies.shift();
    if (waiting[0] === undefined || waiting[0].revision > revision) show(drawnTime - inputTime, drawnTime);
  }
}
