/** How near the shown pictures are to the look. */
import { effect, signal } from "@preact/signals";
import type { Fidelity, HelloMessage } from "../protocol";

/** Whether every shown picture equals the look. */
export const exact = signal(false);
/** Whether an edit was sent that no shown picture has answered yet: what stands there is of before it. */
export const isOutdated = signal(false);
/** Exact, and for a moment: what the status bar says, so that it stands still while a hand drags. */
export const settled = signal(false);
/** Of the shown pictures the worst; of no picture nothing bad is said. */
export const fidelity = signal<Fidelity>("exact");

/** How far the moving picture was from the exact one where an eye rested last, relative RMS; null before. */
export const movingError = signal<number | null>(null);
/** The same as it was measured in the bake, in the scene's own look; null where that is not known. */
export const bakedError = signal<HelloMessage["moving_error"]>(null);

/** As the server ranks them, worst first. */
const ORDER: Fidelity[] = ["preview", "approximate", "followed", "near", "exact"];

export function worst(found: Fidelity[]): Fidelity {
  return ORDER[Math.min(...found.map((each) => ORDER.indexOf(each)), ORDER.length - 1)] as Fidelity;
}

const SETTLED_MS = 250;
effect(() => {
  if (!exact.value) {
    settled.value = false;
    return undefined;
  }
  const timer = setTimeout(() => (settled.value = true), SETTLED_MS);
  return () => clearTimeout(timer);
});
