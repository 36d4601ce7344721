/** Fidelity of the shown images. */
import { effect, signal } from "@preact/signals";
import type { Fidelity, HelloMessage } from "../protocol";

/** True if every shown image is exact. */
export const isFrameExact = signal(false);
/** True if no shown image includes the newest sent edit yet. */
export const isOutdated = signal(false);
/** Exact for a moment, as shown in the status bar, so that it does not flicker during a drag. */
export const isConverged = signal(false);
/** The lowest fidelity of the shown images; exact without images. */
export const fidelity = signal<Fidelity>("exact");

/** Relative RMS error of the free-camera image at the last camera stop; null before. */
export const freeCameraError = signal<number | null>(null);
/** The error measured during the bake, in the scene's own look; null if unknown. */
export const bakedFreeCameraError = signal<HelloMessage["free_camera_error"]>(null);

/** Fidelity levels, lowest first. */
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
