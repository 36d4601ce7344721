/** The status bar: connection, latency, exactness, precomputation, bakes, cache. */
import { useComputed } from "@preact/signals";
import { reconnectNow } from "../session/connections";
import { exporting, exportText } from "../panels/looks/renderJob";
import { cancelBake } from "../session/net/api";
import { bakeProgressText, hasProgress, useElapsedSeconds } from "../session/scene/bakeStatus";
import { activeFilters } from "../state/visibility/activeFilters";
import { pendingBake, method } from "../state/bakes";
import { isCameraMoving } from "../state/cameras";
import { connection, freezeStatus, retryInMs } from "../state/connection";
import { isConverged } from "../state/fidelity";
import { latencyMs } from "../state/latency";
import { usesBakedEnvironment, look } from "../state/look";
import { shownPanels } from "../state/panelWidths";
import { membersText } from "../state/collaboration";
import { isPlaying } from "../panels/timeline/playback";
import { toggleComparison } from "../panels/compare/comparison";
import { formatBytes } from "../ui/scale";
import { reportErrors } from "../ui/toasts";
import { connectionMessage } from "./connectionMessages";
import { useCacheGauge } from "./useCacheGauge";

function imageStatusText(): string {
  if (freezeStatus.value?.state === "shading") return `Updating ${freezeStatus.value.label}…`;
  if (freezeStatus.value !== null) return `Preparing ${freezeStatus.value.label}…`;
  if (look.value === null || connection.value !== "open") return "";
  if (!isConverged.value && isPlaying.value) return "Playing";
  if (!isConverged.value && isCameraMoving.value) return "Approximate while the camera moves";
  if (!isConverged.value) return "Refining…";
  return usesBakedEnvironment.value && method.value !== "direct" ? "Exact ✓" : "Exact (this bake) ✓";
}

function bakeStatusText(elapsed: number): string {
  const next = pendingBake.value;
  if (next === null) return "";
  if (next.state === "ready") return "Bake done, loading";
  if (next.state !== "running" && next.state !== "queued") return `Bake ${next.state}`;
  return `Bake: ${bakeProgressText(next, elapsed)}`;
}

export function StatusBar() {
  const cacheBytes = useCacheGauge();
  const elapsed = useElapsedSeconds(pendingBake.value);
  // announced to screen readers: only what changes rarely, without running numbers
  const announced = useComputed(() =>
    [
      connection.value === "open" ? "Connected" : connectionMessage(),
      freezeStatus.value && imageStatusText(),
      membersText.value,
      ...activeFilters.value.map((limit) => limit.label),
    ]
      .filter(Boolean)
      .join(". "),
  );
  const canTryNow = connection.value === "silent" || (connection.value === "reconnecting" && retryInMs.value > 0);
  const running =
    pendingBake.value !== null && (pendingBake.value.state === "running" || pendingBake.value.state === "queued");
  return (
    <footer class="status">
      <span class={`state ${connection.value}`}>
        <i class="indicator" aria-hidden="true" />
        {connectionMessage()}
        {canTryNow && <button onClick={reconnectNow}>Retry now</button>}
      </span>
      <span class="latency" title="From input to the drawn frame">
        Latency {latencyMs.value === null ? "–" : `${latencyMs.value.toFixed(0)} ms`}
      </span>
      <span class={`exactness ${isConverged.value ? "is-exact" : ""}`}>{imageStatusText()}</span>
      <button
        aria-pressed={shownPanels.value.includes("comparison")}
        title="Measure this picture’s error against path tracing"
        disabled={look.value === null}
        onClick={toggleComparison}
      >
        Compare with reference
      </button>
      {freezeStatus.value !== null && (
        <progress max={1} value={freezeStatus.value.progress} aria-label={imageStatusText()} />
      )}
      <span class="spacer" />
      {exporting.value !== null && (
        <span class="bake">
          {exportText(exporting.value)}
          <progress max={1} value={exporting.value.progress} aria-label={exporting.value.exportName} />
          <button disabled={exporting.value.stop === null} onClick={() => exporting.value?.stop?.()}>
            Stop
          </button>
        </span>
      )}
      {pendingBake.value !== null && (
        <span class="bake">
          {bakeStatusText(elapsed)}
          {running && (
            <>
              <progress
                max={1}
                value={hasProgress(pendingBake.value) ? pendingBake.value.progress : undefined}
                aria-label="Bake"
              />
              <button
                onClick={() => pendingBake.value && void reportErrors(() => cancelBake(pendingBake.value?.id ?? ""))}
              >
                Cancel
              </button>
            </>
          )}
        </span>
      )}
      {cacheBytes !== null && cacheBytes > 0 && (
        <span title="Precomputed light transport in the server's memory">Cache {formatBytes(cacheBytes)}</span>
      )}
      <span class="announce" role="status" aria-live="polite">
        {announced.value}
      </span>
    </footer>
  );
}
