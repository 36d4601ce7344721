/** The status bar: connection, latency, exactness, precomputation, bakes, cache. */
import { useComputed } from "@preact/signals";
import { reconnectNow } from "../session/connections";
import { exporting, exportText } from "../panels/looks/renderJob";
import { cancelBake } from "../session/net/api";
import { bakeProgressText, hasProgress, useElapsedSeconds } from "../session/scene/bakeStatus";
import { activeFilters } from "../state/visibility/activeFilters";
import { pendingBake } from "../state/bakes";
import { connection, freezeStatus, retryInMs } from "../state/connection";
import { isConverged } from "../state/fidelity";
import { latencyMs } from "../state/latency";
import { look } from "../state/look";
import { shownPanels } from "../state/panelWidths";
import { membersText } from "../state/collaboration";
import { toggleComparison } from "../panels/compare/comparison";
import { formatBytes } from "../ui/scale";
import { reportErrors } from "../ui/toasts";
import { connectionMessage } from "./connectionMessages";
import { imageStatusText } from "./imageStatus";
import { useCacheGauge } from "./useCacheGauge";

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
      freezeStatus.value && imageStatusText.value,
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
      <span class={`exactness ${isConverged.value ? "is-exact" : ""}`} title={imageStatusText.value}>
        {imageStatusText.value}
      </span>
      <button
        aria-pressed={shownPanels.value.includes("comparison")}
        title="Measure this picture’s error against path tracing"
        disabled={look.value === null}
        onClick={toggleComparison}
      >
        Compare with reference
      </button>
      {freezeStatus.value !== null && (
        <progress max={1} value={freezeStatus.value.progress} aria-label={imageStatusText.value} />
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
