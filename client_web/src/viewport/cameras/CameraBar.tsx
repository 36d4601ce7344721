/** Bar below a free-camera image: camera controls, renderer choice, and camera options. */
import { computed } from "@preact/signals";
import { useState } from "preact/hooks";
import {
  setRenderer,
  rendererChoice,
  isClientRendering,
  TEXEL_SHADING_NOTE,
  tracesLobes,
  type RendererMode,
} from "../../session/clientRendering";
import { usesTexelShading } from "../../state/look";
import { scene } from "../../state/scene";
import { activeView, sideBySide, activeViewName, views } from "../../state/views";
import { CameraMenu } from "./CameraMenu";
import { freeCameraOf } from "./freeCamera";
import { CAMERA_STEPS, NAVIGATION_HELP, NAVIGATION_LABELS } from "./cameraSteps";
import { navigation, toggleNavigation } from "./navigation";
import { cameraKeyStep } from "./useCameraControl";

const BROWSER_TITLE =
  "This browser draws while the camera moves and loads no pictures. The server draws sharp shadows of the sun and of small " +
  "lights, contact lines and one-pixel highlights too; scenes with glass or cutouts are always the server's.";
const SERVER_TITLE = "The server draws while the camera moves and streams each picture.";
const CHOICES: Record<RendererMode, string> = { auto: "Automatic", client: "This browser", server: "Server" };

/** Chooses the renderer of camera motion. */
function RendererSelect() {
  const serverTitle = usesTexelShading.value
    ? TEXEL_SHADING_NOTE
    : tracesLobes.value
      ? "The server draws while the camera moves, because polished materials are ray traced."
      : SERVER_TITLE;
  const title = isClientRendering.value ? BROWSER_TITLE : serverTitle;
  return (
    <label class="renderer-choice" title={title}>
      Renderer
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

/** Label of the bar, with the active view's name if several are shown. */
export const cameraMessage = computed(() => (sideBySide.value ? `Camera of ${activeViewName.value}` : "Camera"));

export function CameraBar() {
  const [open, setOpen] = useState(true);
  const name = activeViewName.value;
  const moves = views.value.find((view) => view.name === name)?.camera_mode === "free";
  const freeCamera = moves ? freeCameraOf(name) : null;
  const [sceneId, mode] = [scene.value?.id ?? null, navigation.value];
  void activeView.value; // re-render when the camera moves
  if (freeCamera === null) return null;
  return (
    <div class="camera-bar" role="group" aria-label="Camera">
      <button aria-expanded={open} title={NAVIGATION_HELP[mode]} onClick={() => setOpen(!open)}>
        {cameraMessage} {open ? "▾" : "▸"}
      </button>
      {open && (
        <>
          <button
            aria-pressed={mode === "walk"}
            title={`${NAVIGATION_HELP[mode === "walk" ? "orbit" : "walk"]} (O)`}
            onClick={toggleNavigation}
          >
            {NAVIGATION_LABELS.walk}
          </button>
          {CAMERA_STEPS[mode].map(({ key, sign, label }) => (
            <button key={key} title={label} aria-label={label} onClick={() => cameraKeyStep(freeCamera, key, false)}>
              {sign}
            </button>
          ))}
          {freeCamera.interior !== null && (
            <button title="Put the camera in the largest room (I)" onClick={() => freeCamera.goInside()}>
              Inside
            </button>
          )}
          <button
            title="Return to the previous camera (B)"
            disabled={!freeCamera.hasPrevious}
            onClick={() => freeCamera.goBack()}
          >
            Back
          </button>
          <button title="Return to the initial camera (Home)" onClick={() => freeCamera.restart()}>
            Reset view
          </button>
          <RendererSelect />
          {sceneId !== null && <CameraMenu scene={sceneId} freeCamera={freeCamera} name={name} />}
        </>
      )}
    </div>
  );
}
