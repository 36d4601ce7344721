/** Progress shown before the first image. */
import type { ViewImage } from "../render/viewImage";
import { bakeProgressText, hasProgress, phaseText, useElapsedSeconds } from "../session/scene/bakeStatus";
import { bake, pendingBake } from "../state/bakes";
import { connection, freezeStatus, rejectionMessage } from "../state/connection";
import { displayedFrames } from "../state/display";

interface BusyMessage {
  text: string;
  /** Text for screen readers, without running numbers. */
  announced: string;
  /** Undefined: indeterminate; null: no progress bar. */
  progress: number | undefined | null;
}

function busyMessage(view: string, elapsed: number): BusyMessage {
  const next = pendingBake.value;
  if (bake.value === null && next !== null && next.state !== "ready")
    return {
      text: `Preview: ${bakeProgressText(next, elapsed)}`,
      announced: `Preview: ${phaseText(next)}`,
      progress: hasProgress(next) ? next.progress : undefined,
    };
  const job = freezeStatus.value;
  if (connection.value === "open" && job?.view === view) {
    const activity = job.label === "a preview" ? "Rendering" : `Rendering ${job.label}`;
    const percent = Math.round(100 * job.progress);
    return { text: `${activity}… ${percent} %`, announced: `${activity}…`, progress: job.progress };
  }
  const text = {
    reconnecting: rejectionMessage.value === null ? "Waiting for the server…" : `Waiting: ${rejectionMessage.value}`,
    silent: "Waiting for the server…",
    closed: "No picture available",
    connecting: "Opening the scene…",
    open: "Waiting for the first picture…",
  };
  return { text: text[connection.value], announced: text[connection.value], progress: null };
}

export function BusyOverlay({ image }: { image: ViewImage }) {
  void displayedFrames.value;
  const elapsed = useElapsedSeconds(pendingBake.value);
  if (image.hasPixels) return null;
  const { text, announced, progress } = busyMessage(image.view, elapsed);
  return (
    <div class="waiting">
      <p>{text}</p>
      {progress !== null && <progress max={1} value={progress} aria-label={announced} />}
      <span class="announce" role="status">
        {announced}
      </span>
    </div>
  );
}
