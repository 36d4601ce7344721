/** The light around the scene: which one it is, how bright, which way it is turned, and its tint. */
import { useRef } from "preact/hooks";
import { ColorField } from "../inspector/ColorField";
import { edit } from "../state/edit";
import { hold } from "../state/live";
import { ENVIRONMENT, toggleLightSolo } from "../state/solo";
import { defaultLook, look, soloLight } from "../state/store";
import { IconButton } from "../ui/Button";
import { LabelledSlider } from "../ui/LabelledSlider";
import { imported, offerToDelete } from "./environments";
import { EnvironmentGallery, ImportEnvironment } from "./EnvironmentGallery";

export function EnvironmentPanel() {
  const shown = look.value?.environment;
  /** How bright it was when it was switched off. */
  const before = useRef(1);
  const initial = defaultLook.value?.environment;
  if (shown === undefined || initial === undefined) return null;
  const toggle = () => {
    if (shown.scale > 0) before.current = shown.scale;
    edit(shown.scale > 0 ? "Environment off" : "Environment on", "/environment/scale", shown.scale > 0 ? 0 : before.current);
  };
  return (
    <>
      <header class="panel-head">
        <h2 class="spacer">Environment</h2>
        <IconButton
          icon="lamp"
          label={`Environment: ${shown.scale > 0 ? "switch off" : "switch on"}`}
          pressed={shown.scale > 0}
          onClick={toggle}
        />
        <IconButton
          icon="solo"
          label="Environment alone"
          pressed={soloLight.value === ENVIRONMENT}
          onClick={() => toggleLightSolo(ENVIRONMENT)}
        />
        {imported.value !== null && (
          <IconButton
            icon="trash"
            label={`Delete the environment ${imported.value.name}`}
            onClick={() => imported.value && offerToDelete(imported.value)}
          />
        )}
        <ImportEnvironment />
      </header>
      <EnvironmentGallery />
      <LabelledSlider
        shown="Brightness"
        label="Environment brightness"
        value={shown.scale}
        initial={initial.scale}
        minimum={0.01}
        maximum={100}
        scale="log"
        unit="×"
        onChange={(value) => edit("Environment brightness", "/environment/scale", value)}
      />
      <LabelledSlider
        shown="Rotation"
        label="Environment rotation"
        value={shown.rotation}
        initial={initial.rotation}
        minimum={-180}
        maximum={180}
        scale="linear"
        unit="°"
        onChange={(value) => edit("Environment rotation", "/environment/rotation", value)}
        onHold={() => hold("/environment/rotation")}
      />
      <div class="param alone">
        <span class="param-label">Tint</span>
        <ColorField
          label="Environment tint"
          value={shown.color}
          initial={initial.color}
          onChange={(value) => edit("Environment tint", "/environment/color", value)}
        />
      </div>
    </>
  );
}
