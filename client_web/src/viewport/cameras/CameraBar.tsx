/** Over an image with a free camera: its controls as buttons, the renderer, and the camera. */
import { computed } from "@preact/signals";
import { useState } from "preact/hooks";
import { setRenderer, rendererChoice, isClientRendering, type RendererMode } from "../../session/clientRendering";
import { usesTexelShading } from "../../state/look";
import { scene } from "../../state/scene";
import { sideBySide, activeViewName, views } from "../../state/views";
import { CameraMenu } from "./CameraMenu";
import { freeCameraOf } from "./freeCamera";
import { CAMERA_STEPS } from "./cameraSteps";
import { orbitKeyStep } from "./useCameraControl";

const BROWSER_TITLE = "This browser draws while the eye moves: nothing goes over the network for it. Bright rims a pixel thin are smoothed where the server draws";
const SERVER_TITLE = "The server draws while the eye moves, and sends each picture";
const CHOICES: Record<RendererMode, string> = { auto: "automatic", client: "this browser", server: "the server" };

/** Who draws while the camera moves. */
function RendererSelect() {
  const serverTitle = usesTexelShading.value ? "The server draws while the eye moves: it shows textures from all sides, or images that are projected" : SERVER_TITLE;
  const title = isClientRendering.value ? BROWSER_TITLE : serverTitle;
  return (
    <label class="drawn-by" title={title}>
      Drawn by
      <select value={rendererChoice.value} onChange={(event) => setRenderer(event.currentTarget.value as RendererMode)}>
        {Object.entries(CHOICES).map(([value, label]) => (
          <option key={value} value={value}>
            {label}
          </option>
        ))}
      </select>
    </label>
  );
}

/** Whose camera it is: one of several views has the focus. */
export const cameraMessage = computed(() => (sideBySide.value ? `Eye of ${activeViewName.value}` : "Eye"));

export function CameraBar() {
  const [open, setOpen] = useState(true);
  const name = activeViewName.value;
  const moves = views.value.find((view) => view.name === name)?.camera_mode === "free";
  const freeCamera = moves ? freeCameraOf(name) : null;
  const sceneId = scene.value?.id ?? null;
  if (freeCamera === null) return null;
  return (
    <div class="eye-bar" role="group" aria-label="Move the eye">
      <button aria-expanded={open} title="Drag turns, Shift or the right button slides, the wheel goes nearer" onClick={() => setOpen(!open)}>
        {cameraMessage} {open ? "▾" : "▸"}
      </button>
      {open && (
        <>
          {CAMERA_STEPS.map(({ key, sign, label }) => (
            <button key={key} title={label} aria-label={label} onClick={() => orbitKeyStep(freeCamera.change, freeCamera.bounds, key, false)}>
              {sign}
            </button>
          ))}
          <button title="Back to where the eye began (Home)" onClick={() => freeCamera.restart()}>
            Back
          </button>
          <RendererSelect />
          {sceneId !== null && <CameraMenu scene={sceneId} freeCamera={freeCamera} name={name} />}
        </>
      )}
    </div>
  );
}
