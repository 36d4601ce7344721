/** Bar below a free-camera image: camera controls, and camera options. */
import { computed } from "@preact/signals";
import { useState } from "preact/hooks";
import { scene } from "../../state/scene";
import { activeView, sideBySide, activeViewName, views } from "../../state/views";
import { CameraMenu } from "./CameraMenu";
import { freeCameraOf } from "./freeCamera";
import { CAMERA_STEPS, NAVIGATION_HELP, NAVIGATION_LABELS } from "./cameraSteps";
import { navigation, toggleNavigation } from "./navigation";
import { cameraKeyStep } from "./useCameraControl";

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
          {sceneId !== null && <CameraMenu scene={sceneId} freeCamera={freeCamera} name={name} />}
        </>
      )}
    </div>
  );
}
