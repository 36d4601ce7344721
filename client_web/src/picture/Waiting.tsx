/** Before the first picture: what is waited for, and for how long. */
import { bake, coming, connection, drawn } from "../state/store";
import { formatSeconds } from "../ui/scale";
import { stage } from "./stage";

function words(): { text: string; progress: number | null } {
  const next = coming.value;
  if (bake.value === null && next !== null && next.state !== "ready") {
    const left = next.seconds_left === null ? "" : `, ${formatSeconds(next.seconds_left)} left`;
    const text = next.state === "queued" ? "The preview waits for its turn" : `Baking a preview${left}`;
    return { text, progress: next.progress };
  }
  return { text: connection.value === "reconnecting" ? "Waiting for the server" : "Opening the scene", progress: null };
}

export function Waiting() {
  drawn.value;
  if (stage.hasPicture) return null;
  const { text, progress } = words();
  return (
    <div class="waiting" role="status">
      <p>{text}</p>
      {progress !== null && <progress max={1} value={progress} aria-label={text} />}
    </div>
  );
}
