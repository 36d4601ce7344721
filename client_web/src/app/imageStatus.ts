/** Text of the status bar about the image: what is rendered, and whether it is exact. */
import { computed, effect, signal } from "@preact/signals";
import { isPlaying } from "../panels/timeline/playback";
import { method } from "../state/bakes";
import { isCameraMoving } from "../state/cameras";
import { connection, freezeStatus } from "../state/connection";
import { isConverged } from "../state/fidelity";
import { look, usesBakedEnvironment } from "../state/look";

type Kind = "none" | "stage" | "approximate" | "exact";

interface ImageStatus {
  text: string;
  kind: Kind;
}

function currentStatus(): ImageStatus {
  const stage = freezeStatus.value;
  if (stage !== null)
    return { text: `${stage.state === "shading" ? "Updating" : "Preparing"} ${stage.label}…`, kind: "stage" };
  if (look.value === null || connection.value !== "open") return { text: "", kind: "none" };
  if (isConverged.value)
    return {
      text: usesBakedEnvironment.value && method.value !== "direct" ? "Exact ✓" : "Exact (this bake) ✓",
      kind: "exact",
    };
  if (isPlaying.value) return { text: "Playing", kind: "approximate" };
  return { text: isCameraMoving.value ? "Approximate while the camera moves" : "Refining…", kind: "approximate" };
}

/** Longest time between two stages, or from the last one to the exact image. */
const BETWEEN_STAGES_MS = 400;

const status = computed(currentStatus);
const shown = signal<ImageStatus>({ text: "", kind: "none" });
// the text of a stage stays until the next one or the exact image, so that nothing flickers in between
effect(() => {
  const next = status.value;
  if (shown.peek().kind !== "stage" || next.kind !== "approximate") {
    shown.value = next;
    return undefined;
  }
  const timer = setTimeout(() => (shown.value = next), BETWEEN_STAGES_MS);
  return () => clearTimeout(timer);
});

export const imageStatusText = computed(() => shown.value.text);
