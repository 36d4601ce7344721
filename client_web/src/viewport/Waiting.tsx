/** Before the first picture: what is waited for, and for how long. */
import type { Picture } from "../picture/picture";
import { bakingWords, hasProgress, phaseWords, useElapsed } from "../scene/baking";
import { bake, coming } from "../state/bakes";
import { connection, freezing, refusedBecause } from "../state/connection";
import { drawn } from "../state/display";

interface Words {
  text: string;
  /** Without numbers that run. */
  announced: string;
  /** Null where nothing is measured, not even that something goes on. */
  progress: number | undefined | null;
}

function words(view: string, elapsed: number): Words {
  const next = coming.value;
  if (bake.value === null && next !== null && next.state !== "ready")
    return {
      text: `Preview: ${bakingWords(next, elapsed)}`,
      announced: `Preview: ${phaseWords(next)}`,
      progress: hasProgress(next) ? next.progress : undefined,
    };
  const making = freezing.value;
  if (connection.value === "open" && making?.view === view) {
    const doing = making.what === "a preview" ? `Shading ${view}` : `Shading ${view}: ${making.what}`;
    const percent = Math.round(100 * making.progress);
    return { text: `${doing}… ${percent} %`, announced: `${doing}…`, progress: making.progress };
  }
  const text = {
    reconnecting: refusedBecause.value === null ? "Waiting for the server" : `Waiting: ${refusedBecause.value}`,
    silent: "Waiting for the server",
    closed: "There is no picture to show",
    connecting: "Opening the scene",
    open: "Waiting for the first picture",
  };
  return { text: text[connection.value], announced: text[connection.value], progress: null };
}

export function Waiting({ picture }: { picture: Picture }) {
  drawn.value;
  const elapsed = useElapsed(coming.value);
  if (picture.isThere) return null;
  const { text, announced, progress } = words(picture.view, elapsed);
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
