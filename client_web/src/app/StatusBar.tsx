/** What is going on, in words: connection, latency, exactness, freezing, bakes, memory. */
import { useComputed } from "@preact/signals";
import { reconnectNow } from "../live/connections";
import { exporting, exportingWords } from "../looks/rendering";
import { cancelBake } from "../net/api";
import { bakingWords, hasProgress, useElapsed } from "../scene/baking";
import { limits } from "../seen/limits";
import { coming, method } from "../state/bakes";
import { connection, freezing, retryInMs } from "../state/connection";
import { settled } from "../state/fidelity";
import { latencyMs } from "../state/latency";
import { bakedLight, look } from "../state/look";
import { shownPanels } from "../state/room";
import { companyWords } from "../state/together";
import { moves } from "../state/views";
import { playing } from "../timeline/play";
import { toggleTruth } from "../truth/truth";
import { formatBytes } from "../ui/scale";
import { attempt } from "../ui/toasts";
import { connectionWords } from "./connectionWords";
import { useMemory } from "./memory";

function pictureWords(): string {
  if (freezing.value?.state === "shading") return `Shading ${freezing.value.what}`;
  if (freezing.value !== null) return `Preparing ${freezing.value.what}`;
  if (look.value === null || connection.value !== "open") return "";
  if (!settled.value && playing.value) return "playing";
  if (!settled.value) return moves.value ? "approximate until the eye rests" : "refining…";
  return bakedLight.value && method.value !== "direct" ? "exact ✓" : "exact for this bake ✓";
}

function bakeWords(elapsed: number): string {
  const next = coming.value;
  if (next === null) return "";
  if (next.state === "ready") return "Bake ready, opening";
  if (next.state !== "running" && next.state !== "queued") return `Bake ${next.state}`;
  return `Bake: ${bakingWords(next, elapsed)}`;
}

export function StatusBar() {
  const memory = useMemory();
  const elapsed = useElapsed(coming.value);
  // announced: only what changes seldom, without the numbers that run
  const announced = useComputed(() =>
    [
      connection.value === "open" ? "Connected" : connectionWords(),
      freezing.value && pictureWords(),
      companyWords.value,
      ...limits.value.map((limit) => limit.words),
    ]
      .filter(Boolean)
      .join(". "),
  );
  const canTryNow = connection.value === "silent" || (connection.value === "reconnecting" && retryInMs.value > 0);
  const running = coming.value !== null && (coming.value.state === "running" || coming.value.state === "queued");
  return (
    <footer class="status">
      <span class={`state ${connection.value}`}>
        <i class="lamp" aria-hidden="true" />
        {connectionWords()}
        {canTryNow && <button onClick={reconnectNow}>Now</button>}
      </span>
      <span class="latency" title="From the hand to the drawn frame">
        edit → picture {latencyMs.value === null ? "–" : `${latencyMs.value.toFixed(0)} ms`}
      </span>
      <span class={`exactness ${settled.value ? "is-exact" : ""}`}>{pictureWords()}</span>
      <button 
        aria-pressed={shownPanels.value.includes("truth")}
        title="Compare this picture with brute force"
        disabled={look.value === null}
        onClick={toggleTruth}
      >
        How true is this?
      </button>
      {freezing.value !== null && <progress max={1} value={freezing.value.progress} aria-label={pictureWords()} />}
      <span class="spacer" />
      {exporting.value !== null && (
        <span class="bake">
          {exportingWords(exporting.value)}
          <progress max={1} value={exporting.value.progress} aria-label={exporting.value.what} />
          <button disabled={exporting.value.stop === null} onClick={() => exporting.value?.stop?.()}>
            Stop
          </button>
        </span>
      )}
      {coming.value !== null && (
        <span class="bake">
          {bakeWords(elapsed)}
          {running && (
            <>
              <progress max={1} value={hasProgress(coming.value) ? coming.value.progress : undefined} aria-label="Bake" />
              <button onClick={() => coming.value && void attempt(() => cancelBake(coming.value?.id ?? ""))}>
                Cancel
              </button>
            </>
          )}
        </span>
      )}
      {memory !== null && memory > 0 && (
        <span title="Frozen transport that the server holds in memory">frozen {formatBytes(memory)}</span>
      )}
      <span class="announce" role="status" aria-live="polite">
        {announced.value}
      </span>
    </footer>
  );
}
