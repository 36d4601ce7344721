/** The error map beside the image, and what it means. */
import { useRef, useState } from "preact/hooks";
import { comparisonImageUrl } from "../../session/net/api";
import type { ComparisonBody } from "../../protocol";
import { IconButton } from "../../ui/IconButton";
import { useReturnFocus } from "../../ui/restoreFocus";
import { type RadioOption, RadioRow } from "../../ui/RadioRow";
import { beginComparison, continueComparison, haltComparison, isInProgress, comparedState, toggleComparison, activeComparison, comparisonPlan } from "./comparison";
import { mapSentences, omittedPathSentences, type ComparedPaths, comparisonPlanText, comparisonProgressText, errorSentences } from "./comparisonMessages";

type ComparisonView = "error" | "reference";

const COMPARISON_VIEWS: readonly RadioOption<ComparisonView>[] = [
  { value: "error", label: "Error", title: "Where the picture is too dark or too bright" },
  { value: "reference", label: "Brute force", title: "The picture made the slow way" },
];
const COMPARED_PATHS: readonly RadioOption<ComparedPaths>[] = [
  { value: "all", label: "All light paths", title: "Against all light that the scene has" },
  { value: "method", label: "The method's", title: "Against the light that the method follows" },
];

function ErrorScale() {
  return (
    <p class="truth-scale">
      <span>
        <i class="too-dark" aria-hidden="true" /> a quarter stop too dark
      </span>
      <span>
        <i class="as-it-is" aria-hidden="true" /> within the noise
      </span>
      <span>
        <i class="too-bright" aria-hidden="true" /> too bright
      </span>
    </p>
  );
}

/** What can be done now: begin, stop, go on, begin again. */
function ComparisonButtons({ isOld: isOutdated }: { isOld: boolean }) {
  const body = activeComparison.value?.body;
  if (body === undefined) return <button onClick={() => void beginComparison()}>Begin</button>;
  return (
    <div class="group" role="group" aria-label="Comparison">
      {isInProgress(body) && <button onClick={() => void haltComparison()}>Stop</button>}
      {body.state === "stopped" && <button onClick={() => void continueComparison()}>Go on</button>}
      <button onClick={() => void beginComparison()}>{isOutdated ? "Ask again for this picture" : "Begin again"}</button>
    </div>
  );
}

/** The images of a comparison, and what it has found. */
function ComparisonResult({ body }: { body: ComparisonBody }) {
  const [view, setView] = useState<ComparisonView>("error");
  const [selectedPaths, setPaths] = useState<ComparedPaths>("all");
  const paths = body.omitted_paths.length === 0 ? "all" : selectedPaths;
  const errorStats = paths === "all" ? body.error_all_paths : body.error_method_paths;
  if (errorStats === null) return null;
  const file = paths === "all" ? view : (`method-${view}` as const);
  return (
    <>
      <ul class="truth-verdicts" aria-live="polite" aria-label="How far it is from brute force">
        {errorSentences(body).map((sentence) => (
          <li key={sentence}>{sentence}</li>
        ))}
      </ul>
      {body.omitted_paths.length > 0 && <RadioRow label="Light paths" choices={COMPARED_PATHS} selected={selectedPaths} onSelect={(value) => setPaths(value)} />}
      <img src={comparisonImageUrl(body.id, file, body.completed)} alt={view === "error" ? "Error map" : "Brute force"} />
      <RadioRow label="Picture shown" choices={COMPARISON_VIEWS} selected={view} onSelect={(value) => setView(value)} />
      {view === "error" && <ErrorScale />}
      <ul class="truth-notes" aria-live="polite" aria-label="What the map shows">
        {[...mapSentences(errorStats), ...omittedPathSentences(body)].map((sentence) => (
          <li key={sentence}>{sentence}</li>
        ))}
      </ul>
    </>
  );
}

/** Something to look at, of which nothing can be said yet. */
function FirstPass({ body }: { body: ComparisonBody }) {
  return (
    <>
      <img src={comparisonImageUrl(body.id, "reference", body.completed)} alt="Brute force" />
      <p class="truth-scale">
        {body.completed === 0 ? "A small brute force of few samples meanwhile." : "Brute force after one pass."} From the second pass
        on it is compared.
      </p>
    </>
  );
}

export function ComparisonPanel() {
  const panel = useRef<HTMLElement>(null);
  useReturnFocus(panel);
  const body = activeComparison.value?.body;
  const elapsed = activeComparison.value === null ? 0 : (Date.now() - activeComparison.value.since) / 1000; // it is asked for every second
  const isOld = activeComparison.value !== null && activeComparison.value.look !== comparedState();
  return (
    <aside ref={panel} class="truth beside-picture" aria-label="How true is this picture?">
      <header class="panel-head">
        <h2>How true is this?</h2>
        <IconButton icon="close" label="Close" onClick={toggleComparison} />
      </header>
      {body === undefined && (
        <>
          <p>Compares the picture with one made the slow way, by a ray for every light that is drawn.</p>
          <p role="status">{comparisonPlanText(comparisonPlan.value)}</p>
        </>
      )}
      {body !== undefined && (
        <>
          <p>{comparisonProgressText(body, elapsed)}</p>
          {isInProgress(body) && (
            <progress max={1} value={body.progress > 0 ? body.progress : undefined} aria-label="Brute force" />
          )}
          {body.error_all_paths !== null && <ComparisonResult body={body} />}
          {body.error_all_paths === null && body.progress > 0 && <FirstPass body={body} />}
        </>
      )}
      {isOld && <p class="truth-old">The picture has changed since.</p>}
      <ComparisonButtons isOld={isOld} />
    </aside>
  );
}
