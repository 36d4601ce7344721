/** How near the image is to its look, in the image's corner: said where it is not exact for longer than a blink, so
 * that nothing flickers during a drag. */
import { computed, effect, signal, untracked } from "@preact/signals";
import type { Fidelity } from "../protocol";
import { DEFAULT_BAKE_METHOD, methodLabelsOf } from "../session/scene/bakeMethods";
import { method } from "../state/bakes";
import { bakedFreeCameraError, fidelity, isOutdated, freeCameraError, isConverged } from "../state/fidelity";
import { usesBakedEnvironment } from "../state/look";
import { hasFreeCamera } from "../state/views";
import { isPlaying } from "../panels/timeline/playback";

export interface FidelityMark {
  label: string;
  title: string;
}

const MARKS: Record<Exclude<Fidelity, "exact">, FidelityMark> = {
  preview: { label: "Preview", title: "A few points are shaded, the others guessed from them. All are shaded next." },
  approximate: { label: "Updating…", title: "The picture is of a moment ago; what the new one needs is being made." },
  incremental: { label: "Followed closely", title: "What the hand changes is followed roughly. Exact at rest." },
  near_exact: { label: "Nearly exact", title: "What the hand changes is followed closely. Exact at rest." },
};
const OTHER_LIGHT_MARK: FidelityMark = {
  label: "Baked for other light",
  title: "Shadows were baked before this light was known: those of small lamps are approximate. A new bake mends it.",
};

const DIRECT_ONLY_MARK: FidelityMark = {
  label: "Direct light only",
  title: `Objects are not reflected, in metal and glass neither, and do not light each other. A bake “${methodLabelsOf(DEFAULT_BAKE_METHOD).label}” shows both.`,
};

const PLAYBACK_MARK: FidelityMark = {
  label: "Playing",
  title: "Frames of the time line, as near to it as each comes in time. Exact where it is paused.",
};

const FREE_CAMERA_REASON = "Light is kept at points of the surfaces: fine shadows and sharp highlights are softer.";
const WHEN_STOPPED = "Where the eye rests the exact picture follows.";

const formatPercent = (fraction: number) => (fraction < 0.095 ? (100 * fraction).toFixed(1) : `${Math.round(100 * fraction)}`);

/** With how far it is off: where the camera rested last, else as it was measured in the bake. */
function freeCameraMark(): FidelityMark {
  const [errorWhenStopped, baked] = [freeCameraError.value, bakedFreeCameraError.value];
  const off = errorWhenStopped ?? baked?.value ?? null;
  if (off === null) return { label: "Moving view, approximate", title: `${FREE_CAMERA_REASON} ${WHEN_STOPPED}` };
  const measured =
    baked === null ? "" : ` In the bake, in the scene's own look, it was ${formatPercent(baked.value)} ± ${formatPercent(baked.standard_error)} % off (RMS of surfaces, standard error).`;
  const idleError = errorWhenStopped === null ? "" : ` Where the eye rested last this was ${formatPercent(errorWhenStopped)} % of the picture (RMS).`;
  return { label: `Moving view, about ${formatPercent(off)} % off`, title: `${FREE_CAMERA_REASON}${measured}${idleError} ${WHEN_STOPPED}` };
}

const SHOWN_AFTER_MS = 300;
const roughSince = signal<Exclude<Fidelity, "exact"> | null>(null);

function updateRoughMark(): void {
  const now = fidelity.peek();
  if (now !== "exact") roughSince.value = now;
}

const isRough = computed(() => fidelity.value !== "exact");
effect(() => {
  if (isConverged.value) roughSince.value = null;
});
effect(() => {
  const timer = isRough.value ? setTimeout(updateRoughMark, SHOWN_AFTER_MS) : undefined;
  return () => clearTimeout(timer);
});
/** The image is of before the newest edit, for longer than a blink. */
const isLate = signal(false);
effect(() => {
  const timer = isOutdated.value ? setTimeout(() => (isLate.value = true), SHOWN_AFTER_MS) : undefined;
  if (!isOutdated.value && isLate.peek()) {
    isLate.value = false;
    untracked(updateRoughMark); // the previous label stays with the next, without a delay
  }
  return () => clearTimeout(timer);
});

// a displayed label changes when another one has lasted
effect(() => {
  const timer = fidelity.value !== roughSince.peek() && roughSince.peek() !== null ? setTimeout(updateRoughMark, SHOWN_AFTER_MS) : undefined;
  return () => clearTimeout(timer);
});

function viewMark(now: Exclude<Fidelity, "exact">): FidelityMark {
  return hasFreeCamera.value && now === "approximate" ? freeCameraMark() : MARKS[now];
}

/** Current labels: of the image, and of what its bake does not include. */
export function fidelityMarks(): FidelityMark[] {
  const phrase = isLate.value ? "approximate" : roughSince.value;
  const ofImage = phrase === null ? [] : [isPlaying.value ? PLAYBACK_MARK : viewMark(phrase)];
  const ofBake = [...(usesBakedEnvironment.value ? [] : [OTHER_LIGHT_MARK]), ...(method.value === "direct" ? [DIRECT_ONLY_MARK] : [])];
  return [...ofImage, ...ofBake];
}
