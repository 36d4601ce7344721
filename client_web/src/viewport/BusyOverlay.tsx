/** Progress shown before the first image, over a clay picture if there is no bake yet. */
import type { ViewImage } from "../render/viewImage";
import { bakeProgressText, hasProgress, phaseText, useElapsedSeconds } from "../session/scene/bakeStatus";
import { clayUrl } from "../session/net/api";
import { bake, pendingBake } from "../state/bakes";
import { connection, freezeStatus, rejectionMessage } from "../state/connection";
import { displayedFrames } from "../state/display";
import { scene, unbakedAspect } from "../state/scene";
import { ClayImage } from "../ui/ClayImage";

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

const CLAY_SIDE = 960;

/** The shape of a scene without a bake. */
function ClayPicture({ view }: { view: string }) {
  const aspect = unbakedAspect.value;
  if (scene.value === null || aspect === null) return null;
  const width = Math.round(CLAY_SIDE * Math.min(1, aspect));
  const url = clayUrl(scene.value.id, width, { name: view, height: Math.round(width / aspect) });
  return (
    <>
      <ClayImage url={url} label={`Clay picture of ${view}`} />
      <p>Clay picture: shape only. Materials and light come with the bake.</p>
    </>
  );
}

export function BusyOverlay({ image }: { image: ViewImage }) {
  void displayedFrames.value;
  const elapsed = useElapsedSeconds(pendingBake.value);
  if (image.hasPixels) return null;
  const { text, announced, progress } = busyMessage(image.view, elapsed);
  return (
    <div class={`waiting ${unbakedAspect.value === null ? "" : "over-clay"}`}>
      <ClayPicture view={image.view} />
      <p>{text}</p>
      {progress !== null && <progress max={1} value={progress} aria-label={announced} />}
      <span class="announce" role="status">
        {announced}
      </span>
    </div>
  );
}
