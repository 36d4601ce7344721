/** Over a picture whose eye moves: what hands can do, as buttons, who draws, and the camera. */
import { computed } from "@preact/signals";
import { useState } from "preact/hooks";
import { chooseDrawnBy, drawnBy, drawsHere, type Draws } from "../live/drawing";
import { hasTexels } from "../state/look";
import { scene } from "../state/scene";
import { sideBySide, viewName, views } from "../state/views";
import { CameraMenu } from "./CameraMenu";
import { eyeOf } from "./eye";
import { STEPS } from "./steps";
import { step } from "./useHand";

const HERE = "This browser draws while the eye moves: nothing goes over the network for it. Bright rims a pixel thin are smoothed where the server draws";
const SENT = "The server draws while the eye moves, and sends each picture";
const CHOICES: Record<Draws, string> = { auto: "automatic", browser: "this browser", server: "the server" };

/** Who draws while the eye moves. */
function DrawnBy() {
  const there = hasTexels.value ? "The server draws while the eye moves: it shows textures from all sides, or images that are projected" : SENT;
  const title = drawsHere.value ? HERE : there;
  return (
    <label class="drawn-by" title={title}>
      Drawn by
      <select value={drawnBy.value} onChange={(event) => chooseDrawnBy(event.currentTarget.value as Draws)}>
        {Object.entries(CHOICES).map(([value, words]) => (
          <option key={value} value={value}>
            {words}
          </option>
        ))}
      </select>
    </label>
  );
}

/** Whose eye it is: of several views one is in hand. */
export const eyeWords = computed(() => (sideBySide.value ? `Eye of ${viewName.value}` : "Eye"));

export function EyeBar() {
  const [open, setOpen] = useState(true);
  const name = viewName.value;
  const moves = views.value.find((view) => view.name === name)?.eye === "free";
  const eye = moves ? eyeOf(name) : null;
  const of = scene.value?.id ?? null;
  if (eye === null) return null;
  return (
    <div class="eye-bar" role="group" aria-label="Move the eye">
      <button aria-expanded={open} title="Drag turns, Shift or the right button slides, the wheel goes nearer" onClick={() => setOpen(!open)}>
        {eyeWords} {open ? "▾" : "▸"}
      </button>
      {open && (
        <>
          {STEPS.map(({ key, sign, label }) => (
            <button key={key} title={label} aria-label={label} onClick={() => step(eye.change, eye.bounds, key, false)}>
              {sign}
            </button>
          ))}
          <button title="Back to where the eye began (Home)" onClick={() => eye.restart()}>
            Back
          </button>
          <DrawnBy />
          {of !== null && <CameraMenu scene={of} eye={eye} name={name} />}
        </>
      )}
    </div>
  );
}
