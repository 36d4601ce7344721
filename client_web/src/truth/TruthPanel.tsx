/** The error map beside the picture, and what it means. */
import { useRef, useState } from "preact/hooks";
import { truthPicture } from "../net/api";
import type { TruthBody } from "../protocol";
import { IconButton } from "../ui/Button";
import { useReturnFocus } from "../ui/keepFocus";
import { type Choice, RadioRow } from "../ui/RadioRow";
import { askTruth, goOnWithTruth, haltTruth, isGoingOn, judged, toggleTruth, truth, truthPlan } from "./truth";
import { findings, omissions, type Paths, planWords, progressWords, verdicts } from "./words";

type Picture = "error" | "reference";

const PICTURES: readonly Choice<Picture>[] = [
  { value: "error", label: "Error", title: "Where the picture is too dark or too bright" },
  { value: "reference", label: "Brute force", title: "The picture made the slow way" },
];
const PATHS: readonly Choice<Paths>[] = [
  { value: "all", label: "All light paths", title: "Against all light that the scene has" },
  { value: "method", label: "The method's", title: "Against the light that the method follows" },
];

function Scale() {
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
function Steps({ isOld }: { isOld: boolean }) {
  const body = truth.value?.body;
  if (body === undefined) return <button onClick={() => void askTruth()}>Begin</button>;
  return (
    <div class="group" role="group" aria-label="Comparison">
      {isGoingOn(body) && <button onClick={() => void haltTruth()}>Stop</button>}
      {body.state === "stopped" && <button onClick={() => void goOnWithTruth()}>Go on</button>}
      <button onClick={() => void askTruth()}>{isOld ? "Ask again for this picture" : "Begin again"}</button>
    </div>
  );
}

/** The pictures of a comparison, and what it has found. */
function Found({ body }: { body: TruthBody }) {
  const [picture, setPicture] = useState<Picture>("error");
  const [chosen, setPaths] = useState<Paths>("all");
  const paths = body.left_out.length === 0 ? "all" : chosen;
  const found = paths === "all" ? body.found : body.found_of_method;
  if (found === null) return null;
  const file = paths === "all" ? picture : (`method-${picture}` as const);
  return (
    <>
      <ul class="truth-verdicts" aria-live="polite" aria-label="How far it is from brute force">
        {verdicts(body).map((sentence) => (
          <li key={sentence}>{sentence}</li>
        ))}
      </ul>
      {body.left_out.length > 0 && <RadioRow label="Light paths" choices={PATHS} chosen={chosen} onChoose={(value) => setPaths(value)} />}
      <img src={truthPicture(body.id, file, body.passes)} alt={picture === "error" ? "Error map" : "Brute force"} />
      <RadioRow label="Picture shown" choices={PICTURES} chosen={picture} onChoose={(value) => setPicture(value)} />
      {picture === "error" && <Scale />}
      <ul class="truth-notes" aria-live="polite" aria-label="What the map shows">
        {[...findings(found), ...omissions(body)].map((sentence) => (
          <li key={sentence}>{sentence}</li>
        ))}
      </ul>
    </>
  );
}

/** Something to look at, of which nothing can be said yet. */
function First({ body }: { body: TruthBody }) {
  return (
    <>
      <img src={truthPicture(body.id, "reference", body.passes)} alt="Brute force" />
      <p class="truth-scale">
        {body.passes === 0 ? "A small brute force of few samples meanwhile." : "Brute force after one pass."} From the second pass
        on it is compared.
      </p>
    </>
  );
}

export function TruthPanel() {
  const panel = useRef<HTMLElement>(null);
  useReturnFocus(panel);
  const body = truth.value?.body;
  const elapsed = truth.value === null ? 0 : (Date.now() - truth.value.since) / 1000; // it is asked for every second
  const isOld = truth.value !== null && truth.value.look !== judged();
  return (
    <aside ref={panel} class="truth beside-picture" aria-label="How true is this picture?">
      <header class="panel-head">
        <h2>How true is this?</h2>
        <IconButton icon="close" label="Close" onClick={toggleTruth} />
      </header>
      {body === undefined && (
        <>
          <p>Compares the picture with one made the slow way, by a ray for every light that is drawn.</p>
          <p role="status">{planWords(truthPlan.value)}</p>
        </>
      )}
      {body !== undefined && (
        <>
          <p>{progressWords(body, elapsed)}</p>
          {isGoingOn(body) && (
            <progress max={1} value={body.progress > 0 ? body.progress : undefined} aria-label="Brute force" />
          )}
          {body.found !== null && <Found body={body} />}
          {body.found === null && body.progress > 0 && <First body={body} />}
        </>
      )}
      {isOld && <p class="truth-old">The picture has changed since.</p>}
      <Steps isOld={isOld} />
    </aside>
  );
}
