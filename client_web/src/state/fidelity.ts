/** Fidelity of the shown images. */
import { effect, signal } from "@preact/signals";
import { FIDELITIES, type Fidelity, type FreeCameraError } from "../protocol";

/** True if every shown image is exact. */
export const isFrameExact = signal(false);
/** True if no shown image includes the newest sent edit yet. */
export const isOutdated = signal(false);
/** Exact for a moment, as shown in the status bar, so that it does not flicker during a drag. */
export const isConverged = signal(false);
/** The lowest fidelity of the shown images; exact without images. */
export const fidelity = signal<Fidelity>("exact");

/** Error of the image while the camera moved, measured at its last stop; null before. */
export const freeCameraError = signal<FreeCameraError | null>(null);
/** The error measured during the bake, in the scene's own look; null if unknown. */
export const bakedFreeCameraError = signal<FreeCameraError | null>(null);

export function worstFidelity(fidelities: Fidelity[]): Fidelity {
  return FIDELITIES[Math.min(...fidelities.map((each) => FIDELITIES.indexOf(each)), FIDELITIES.length - 1)] as Fidelity;
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
