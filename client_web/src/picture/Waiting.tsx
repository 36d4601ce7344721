/** Before the first picture: what is waited for, and for how long. */
import { bake, coming, connection, drawn, freezing } from "../state/store";
import { formatSeconds } from "../ui/scale";
import type { Picture } from "./picture";

function words(view: string): { text: string; progress: number | null } {
  const next = coming.value;
  if (bake.value === null && next !== null && next.state !== "ready") {
    const left = next.seconds_left === null ? "" : `, ${formatSeconds(next.seconds_left)} left`;
    const text = next.state === "queued" ? "The preview waits for its turn" : `Baking a preview${left}`;
    return { text, progress: next.progress };
  }
  const making = freezing.value;
  if (connection.value === "open" && making?.view === view) {
    const doing = making.what === "a preview" ? `Shading ${view}` : `Shading ${view}: ${making.what}`;
    return { text: `${doing}… ${Math.round(100 * making.progress)} %`, progress: making.progress };
  }
  const text = {
    reconnecting: "Waiting for the server",
    closed: "There is no picture to show",
    connecting: "Opening the scene",
    open: "Waiting for the first picture",
  };
  return { text: text[connection.value], progress: null };
}

export function Waiting({ picture }: { picture: Picture }) {
  drawn.value;
  if (picture.isThere) return null;
  const { text, progress } = words(picture.view);
  return (
    <div class="waiting" role="status">
      <p>{text}</p>
      {progress !== null && <progress max={1} value={progress} aria-label={text} />}
    </div>
  );
}
