/** The environment: choice, brightness, rotation and tint. */
import { useRef } from "preact/hooks";
import { editValue } from "../../edit/edit";
import { beginDrag } from "../../session/prepare";
import { ENVIRONMENT_SOURCE, soloLight, toggleLightSolo } from "../../state/visibility/soloSources";
import { defaultLook, look } from "../../state/look";
import { IconButton } from "../../ui/IconButton";
import { LabeledColor } from "../../ui/LabeledColor";
import { LabeledSlider } from "../../ui/LabeledSlider";
import { Section } from "../../ui/Section";
import { LinkField } from "../lights/LinkField";
import { EnvironmentGallery, ImportEnvironment } from "./EnvironmentGallery";
import { imported, offerToDeleteEnvironment } from "./environments";

function EnvironmentActions({ scale }: { scale: number }) {
  /** Intensity when it was turned off. */
  const previousScale = useRef(1);
  const isOn = scale > 0;
  const toggle = () => {
    if (isOn) previousScale.current = scale;
    editValue(
      isOn ? "Turn off environment" : "Turn on environment",
      "/environment/intensity",
      isOn ? 0 : previousScale.current,
    );
  };
  return (
    <>
      <IconButton icon="light" label={`Turn ${isOn ? "off" : "on"} environment`} pressed={isOn} onClick={toggle} />
      <IconButton
        icon="solo"
        label="Solo environment"
        pressed={soloLight.value === ENVIRONMENT_SOURCE}
        onClick={() => toggleLightSolo(ENVIRONMENT_SOURCE)}
      />
      {imported.value !== null && (
        <IconButton
          icon="trash"
          label={`Delete HDRI ${imported.value.name}`}
          onClick={() => imported.value && offerToDeleteEnvironment(imported.value)}
        />
      )}
      <ImportEnvironment />
    </>
  );
}

export function EnvironmentPanel() {
  const environment = look.value?.environment;
  const initial = defaultLook.value?.environment;
  if (environment === undefined || initial === undefined) return null;
  return (
    <Section title="Environment" actions={<EnvironmentActions scale={environment.intensity} />}>
      <EnvironmentGallery />
      <LabeledSlider
        shortLabel="Brightness"
        label="Environment brightness"
        value={environment.intensity}
        initial={initial.intensity}
        minimum={0.01}
        maximum={100}
        scale="log"
        unit="×"
        onChange={(value) => editValue("Environment brightness", "/environment/intensity", value)}
      />
      <LabeledSlider
        shortLabel="Rotation"
        label="Environment rotation"
        value={environment.rotation}
        initial={initial.rotation}
        minimum={-180}
        maximum={180}
        scale="linear"
        unit="°"
        onChange={(value) => editValue("Environment rotation", "/environment/rotation", value)}
        onHold={() => beginDrag("/environment/rotation")}
      />
      <LabeledColor
        shortLabel="Tint"
        label="Environment tint"
        value={environment.color}
        initial={initial.color}
        onChange={(value) => editValue("Environment tint", "/environment/color", value)}
      />
      <LinkField label="Lights" path="/environment/link" link={environment.link ?? null} />
    </Section>
  );
}
