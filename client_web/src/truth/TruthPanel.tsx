/** The error map beside the picture, and what it means. */
import { useState } from "preact/hooks";
import { truthPicture } from "../net/api";
import { IconButton } from "../ui/Button";
import { askTruth, judged, toggleTruth, truth } from "./truth";
import { findings, progressWords } from "./words";

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
      {body !== undefined && (
        <>
          <p>{progressWords(body)}</p>
          {body.state !== "ready" && body.state !== "failed" && (
            <progress max={1} value={body.progress} aria-label="Brute force" />
          )}
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
      <button onClick={() => void askTruth()}>{isOld ? "Ask again for this look" : "Begin again"}</button>
    </aside>
  );
}
