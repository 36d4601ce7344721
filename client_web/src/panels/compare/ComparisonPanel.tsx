/** The comparison with a reference: an error map beside the image, and its statistics. */
import { useRef, useState } from "preact/hooks";
import { comparisonImageUrl } from "../../session/net/api";
import type { ComparisonBody } from "../../protocol";
import { IconButton } from "../../ui/IconButton";
import { useReturnFocus } from "../../ui/restoreFocus";
import { type RadioOption, RadioRow } from "../../ui/RadioRow";
import {
  beginComparison,
  continueComparison,
  haltComparison,
  isInProgress,
  comparedState,
  toggleComparison,
  activeComparison,
  comparisonPlan,
} from "./comparison";
import {
  mapSentences,
  omittedPathSentences,
  type ComparedPaths,
  comparisonPlanText,
  comparisonProgressText,
  errorSentences,
} from "./comparisonMessages";
import { serverUrl } from "../../session/net/serverUrl";

type ComparisonView = "error" | "reference";

const COMPARISON_VIEWS: readonly RadioOption<ComparisonView>[] = [
  { value: "error", label: "Error", title: "Too dark and too bright areas" },
  { value: "reference", label: "Reference", title: "Path-traced reference" },
];
const COMPARED_PATHS: readonly RadioOption<ComparedPaths>[] = [
  { value: "all", label: "All light paths", title: "Compare with all light in the scene" },
  { value: "method", label: "Simulated paths", title: "Compare only the light paths that this bake simulates" },
];

function ErrorScale() {
  return (
    <p class="comparison-scale">
      <span>
        <i class="too-dark" aria-hidden="true" /> ¼ stop too dark
      </span>
      <span>
        <i class="within-noise" aria-hidden="true" /> within noise
      </span>
      <span>
        <i class="too-bright" aria-hidden="true" /> too bright
      </span>
    </p>
  );
}

/** Buttons for the current state: start, stop, resume, restart. */
function ComparisonButtons({ isOld: isOutdated }: { isOld: boolean }) {
  const body = activeComparison.value?.body;
  if (body === undefined) return <button onClick={() => void beginComparison()}>Start</button>;
  return (
    <div class="group" role="group" aria-label="Comparison">
      {isInProgress(body) && <button onClick={() => void haltComparison()}>Stop</button>}
      {body.state === "canceled" && <button onClick={() => void continueComparison()}>Resume</button>}
      <button onClick={() => void beginComparison()}>{isOutdated ? "Compare this picture" : "Restart"}</button>
    </div>
  );
}

/** The images and statistics of a comparison. */
function ComparisonResult({ body }: { body: ComparisonBody }) {
  const [view, setView] = useState<ComparisonView>("error");
  const [selectedPaths, setPaths] = useState<ComparedPaths>("all");
  const paths = body.omitted_paths.length === 0 ? "all" : selectedPaths;
  const errorStats = paths === "all" ? body.error_all_paths : body.error_method_paths;
  if (errorStats === null) return null;
  const file = paths === "all" ? view : (`method-${view}` as const);
  return (
    <>
      <ul class="comparison-errors" aria-live="polite" aria-label="Error">
        {errorSentences(body).map((sentence) => (
          <li key={sentence}>{sentence}</li>
        ))}
      </ul>
      {body.omitted_paths.length > 0 && (
        <RadioRow
          label="Light paths"
          choices={COMPARED_PATHS}
          selected={selectedPaths}
          onSelect={(value) => setPaths(value)}
        />
      )}
      <img
        src={serverUrl(comparisonImageUrl(body.id, file, body.completed))}
        alt={view === "error" ? "Error map" : "Reference"}
      />
      <RadioRow
        label="Displayed picture"
        choices={COMPARISON_VIEWS}
        selected={view}
        onSelect={(value) => setView(value)}
      />
      {view === "error" && <ErrorScale />}
      <ul class="comparison-notes" aria-live="polite" aria-label="Notes">
        {[...mapSentences(errorStats), ...omittedPathSentences(body)].map((sentence) => (
          <li key={sentence}>{sentence}</li>
        ))}
      </ul>
    </>
  );
}

/** The reference after its first pass, before there are statistics. */
function FirstPass({ body }: { body: ComparisonBody }) {
  return (
    <>
      <img src={serverUrl(comparisonImageUrl(body.id, "reference", body.completed))} alt="Reference" />
      <p class="comparison-scale">
        {body.completed === 0 ? "Low-resolution preview of the reference." : "Reference after one pass."} Results follow
        after the second pass.
      </p>
    </>
  );
}

export function ComparisonPanel() {
  const panel = useRef<HTMLElement>(null);
  useReturnFocus(panel);
  const body = activeComparison.value?.body;
  const elapsed = activeComparison.value === null ? 0 : (Date.now() - activeComparison.value.since) / 1000; // polled every second
  const isOld = activeComparison.value !== null && activeComparison.value.look !== comparedState();
  return (
    <aside ref={panel} class="comparison beside-picture" aria-label="Compare with reference">
      <header class="panel-head">
        <h2>Compare with reference</h2>
        <IconButton icon="close" label="Close" onClick={toggleComparison} />
      </header>
      {body === undefined && (
        <>
          <p>Compares this picture with a brute-force path-traced reference.</p>
          <p role="status">{comparisonPlanText(comparisonPlan.value)}</p>
        </>
      )}
      {body !== undefined && (
        <>
          <p>{comparisonProgressText(body, elapsed)}</p>
          {isInProgress(body) && (
            <progress max={1} value={body.progress > 0 ? body.progress : undefined} aria-label="Reference" />
          )}
          {body.error_all_paths !== null && <ComparisonResult body={body} />}
          {body.error_all_paths === null && body.progress > 0 && <FirstPass body={body} />}
        </>
      )}
      {isOld && <p class="comparison-outdated">The picture has changed since this comparison.</p>}
      <ComparisonButtons isOld={isOld} />
    </aside>
  );
}
