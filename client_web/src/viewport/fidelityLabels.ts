/** Fidelity labels in the image's corner: shown if the image is approximate for a while, so that nothing flickers during
 * a drag. */
import { computed, effect, signal, untracked } from "@preact/signals";
import type { Fidelity, FreeCameraError } from "../protocol";
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
  preview: { label: "Preview", title: "Rendered from a subset of pixels; the full picture follows." },
  approximate: { label: "Updating…", title: "Showing the previous picture while the new one renders." },
  incremental: {
    label: "Approximate",
    title: "This frame follows your edit. The exact picture comes when you let go.",
  },
  near_exact: {
    label: "Almost final",
    title: "Remaining differences are too small to see. The exact picture follows.",
  },
};
const OTHER_LIGHT_MARK: FidelityMark = {
  label: "Baked for a different environment",
  title:
    "This environment was chosen after baking, so bounce light and moving cameras show it more coarsely. Bake again to fix this.",
};

const DIRECT_ONLY_MARK: FidelityMark = {
  label: "Direct light only",
  title: `No bounce light, and objects don't appear in reflections. Bake with “${methodLabelsOf(DEFAULT_BAKE_METHOD).label}” to get both.`,
};

const PLAYBACK_MARK: FidelityMark = {
  label: "Playing",
  title: "Frames may be approximate to keep up. Exact when paused.",
};

const FREE_CAMERA_REASON = "While the camera moves, fine shadows and sharp highlights are softer.";
const WHEN_STOPPED = "The exact picture follows when the camera stops.";

/** Mean color differences ΔE up to which a description holds; 1 is just noticeable between patches side by side. */
const VISIBILITIES: [number, string][] = [
  [1, "hardly visible"],
  [2, "visible up close"],
  [10, "visible at a glance"],
  [Infinity, "strong"],
];

const formatPercent = (fraction: number) =>
  fraction < 0.095 ? (100 * fraction).toFixed(1) : `${Math.round(100 * fraction)}`;

const describe = (delta: number) => VISIBILITIES.find(([limit]) => delta <= limit)?.[1] ?? "strong";

const errorText = ({ delta_e: delta, rms }: FreeCameraError) =>
  `color difference ΔE ${delta.toFixed(1)}; ${formatPercent(rms)} % RMS error of linear radiance`;

/** Label with the error at the last camera stop, else as measured in the bake. */
function freeCameraMark(): FidelityMark {
  const [atStop, baked] = [freeCameraError.value, bakedFreeCameraError.value];
  const error = atStop ?? baked;
  if (error === null) return { label: "Approximate while moving", title: `${FREE_CAMERA_REASON} ${WHEN_STOPPED}` };
  const sentences = [
    FREE_CAMERA_REASON,
    "Average over surfaces, where ΔE 1 is just noticeable.",
    ...(atStop === null ? [] : [`At the last stop: ${errorText(atStop)}.`]),
    ...(baked === null ? [] : [`In the original look: ${errorText(baked)}.`]),
    WHEN_STOPPED,
  ];
  return { label: `Approximate while moving: difference ${describe(error.delta_e)}`, title: sentences.join(" ") };
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
/** True if the image has been older than the newest edit for a while. */
const isLate = signal(false);
effect(() => {
  const timer = isOutdated.value ? setTimeout(() => (isLate.value = true), SHOWN_AFTER_MS) : undefined;
  if (!isOutdated.value && isLate.peek()) {
    isLate.value = false;
    untracked(updateRoughMark); // continue with the next label without a delay
  }
  return () => clearTimeout(timer);
});

// change a displayed label only after another one has lasted
effect(() => {
  const timer =
    fidelity.value !== roughSince.peek() && roughSince.peek() !== null
      ? setTimeout(updateRoughMark, SHOWN_AFTER_MS)
      : undefined;
  return () => clearTimeout(timer);
});

function viewMark(now: Exclude<Fidelity, "exact">): FidelityMark {
  return hasFreeCamera.value && now === "approximate" ? freeCameraMark() : MARKS[now];
}

/** Current labels of the image and of its bake's limits. */
export function fidelityMarks(): FidelityMark[] {
  const phrase = isLate.value ? "approximate" : roughSince.value;
  const ofImage = phrase === null ? [] : [isPlaying.value ? PLAYBACK_MARK : viewMark(phrase)];
  const ofBake = [
    ...(usesBakedEnvironment.value ? [] : [OTHER_LIGHT_MARK]),
    ...(method.value === "direct" ? [DIRECT_ONLY_MARK] : []),
  ];
  return [...ofImage, ...ofBake];
}
