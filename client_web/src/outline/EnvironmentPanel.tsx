/** The light around the scene: which one it is, how bright, which way it is turned, and its tint. */
import { useRef } from "preact/hooks";
import { edit } from "../edit/edit";
import { hold } from "../live/touch";
import { ENVIRONMENT, soloLight, toggleLightSolo } from "../seen/solo";
import { defaultLook, look } from "../state/look";
import { IconButton } from "../ui/Button";
import { LabelledColor } from "../ui/LabelledColor";
import { LabelledSlider } from "../ui/LabelledSlider";
import { Section } from "../ui/Section";
import { EnvironmentGallery, ImportEnvironment } from "./EnvironmentGallery";
import { imported, offerToDelete } from "./environments";

function Actions({ scale }: { scale: number }) {
  /** How bright it was when it was switched off. */
  const before = useRef(1);
  const isOn = scale > 0;
  const toggle = () => {
    if (isOn) before.current = scale;
    edit(isOn ? "Environment off" : "Environment on", "/environment/scale", isOn ? 0 : before.current);
  };
  return (
    <>
      <IconButton
        icon="lamp"
        label={`Environment: ${isOn ? "switch off" : "switch on"}`}
        pressed={isOn}
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
    </>
  );
}

export function EnvironmentPanel() {
  const shown = look.value?.environment;
  const initial = defaultLook.value?.environment;
  if (shown === undefined || initial === undefined) return null;
  return (
    <Section title="Environment" actions={<Actions scale={shown.scale} />}>
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
      <LabelledColor
        shown="Tint"
        label="Environment tint"
        value={shown.color}
        initial={initial.color}
        onChange={(value) => edit("Environment tint", "/environment/color", value)}
      />
    </Section>
  );
}
