/** How near the shown images are to the look. */
import { effect, signal } from "@preact/signals";
import type { Fidelity, HelloMessage } from "../protocol";

/** Whether every shown image equals the look. */
export const isFrameExact = signal(false);
/** Whether an edit was sent that no shown image has answered yet: what stands there is of before it. */
export const isOutdated = signal(false);
/** Exact, and for a moment: what the status bar says, so that it stands still during a drag. */
export const isConverged = signal(false);
/** Of the shown images the worst; of no image nothing bad is said. */
export const fidelity = signal<Fidelity>("exact");

/** How far the free-camera image was from the exact one where a camera rested last, relative RMS; null before. */
export const freeCameraError = signal<number | null>(null);
/** The same as it was measured in the bake, in the scene's own look; null where that is not known. */
export const bakedFreeCameraError = signal<HelloMessage["free_camera_error"]>(null);

/** As the server ranks them, worst first. */
const FIDELITY_ORDER: Fidelity[] = ["preview", "approximate", "incremental", "near_exact", "exact"];

export function worstFidelity(fidelities: Fidelity[]): Fidelity {
  return FIDELITY_ORDER[Math.min(...fidelities.map((each) => FIDELITY_ORDER.indexOf(each)), FIDELITY_ORDER.length - 1)] as Fidelity;
}

const CONVERGED_AFTER_MS = 250;
effect(() => {
  if (!isFrameExact.value) {
    isConverged.value = false;
    return undefined;
  }
  const timer = setTimeout(() => (isConverged.value = true), CONVERGED_AFTER_MS);
  return () => clearTimeout(timer);
});
