/** The error map beside the picture, and what it means. */
import { useState } from "preact/hooks";
import { truthPicture } from "../net/api";
import { IconButton } from "../ui/Button";
import { askTruth, goOnWithTruth, haltTruth, isGoingOn, judged, toggleTruth, truth, truthPlan } from "./truth";
import { findings, planWords, progressWords } from "./words";

const PICTURES = [
  ["error", "Error"],
  ["reference", "Brute force"],
] as const;

function Scale() {
  return (
    <p class="truth-scale">
      <i class="too-dark" aria-hidden="true" /> a quarter stop too dark
      <i class="as-it-is" aria-hidden="true" /> within the noise
      <i class="too-bright" aria-hidden="true" /> too bright
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
      <button onClick={() => void askTruth()}>{isOld ? "Ask again for this look" : "Begin again"}</button>
    </div>
  );
}

export function TruthPanel() {
  const [shown, setShown] = useState<"error" | "reference">("error");
  const body = truth.value?.body;
  const isOld = truth.value !== null && truth.value.look !== judged();
  return (
    <aside class="truth" aria-label="How true is this picture?">
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
          <p>{progressWords(body)}</p>
          {isGoingOn(body) && <progress max={1} value={body.progress} aria-label="Brute force" />}
          {body.found !== null && (
            <>
              <img src={truthPicture(body.id, shown, body.passes)} alt={shown === "error" ? "Error map" : "Brute force"} />
              <div class="group" role="group" aria-label="Picture shown">
                {PICTURES.map(([name, label]) => (
                  <button key={name} aria-pressed={shown === name} onClick={() => setShown(name)}>
                    {label}
                  </button>
                ))}
              </div>
              {shown === "error" && <Scale />}
              <ul aria-live="polite">
                {findings(body.found).map((sentence) => (
                  <li key={sentence}>{sentence}</li>
                ))}
              </ul>
            </>
          )}
        </>
      )}
      {isOld && <p class="truth-old">The look has changed since.</p>}
      <Steps isOld={isOld} />
    </aside>
  );
}
