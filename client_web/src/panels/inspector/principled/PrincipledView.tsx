/** A material as artists know it: principled parameters over its terms. */
import { useEffect, useState } from "preact/hooks";
import { editValue } from "../../../edit/edit";
import { RANGES } from "../../../look.gen";
import type { MaterialLook, PrincipledBody, PrincipledParameters, Rgb } from "../../../protocol";
import { jsonPointer } from "../../../state/document/pointer";
import { look } from "../../../state/look";
import { LabeledColor } from "../../../ui/LabeledColor";
import { LabeledSlider } from "../../../ui/LabeledSlider";
import { meshLightOf } from "../images/emission";
import { editedParameters, editPrincipled, readMaterial, replaceByClosest, storedReading } from "./principled";
import { closestText, GROUPS, isShown, type Control } from "./controls";

interface Props {
  material: string;
  materialLook: MaterialLook;
}

/** The reading of a material, or the previous one of it until then; a message if it cannot be read. */
function useReading({ material, materialLook }: Props): PrincipledBody | string | null {
  const stored = storedReading(material, materialLook);
  const [last, setLast] = useState<PrincipledBody | string | null>(null);
  useEffect(() => {
    let isOld = false;
    readMaterial(material, materialLook).then(
      (reading) => !isOld && setLast(reading),
      (error: unknown) => !isOld && setLast(error instanceof Error ? error.message : String(error)),
    );
    return () => {
      isOld = true;
    };
  }, [material, materialLook]);
  return stored ?? last;
}

function ControlRow({ control, parameters }: { control: Control; parameters: PrincipledParameters }) {
  const { name, label, shortLabel, title } = control;
  const value = parameters[name];
  const range = RANGES.principled[name];
  const change = (next: number | Rgb) => void editPrincipled(label, parameters, { [name]: next });
  if (typeof value === "number")
    return (
      <LabeledSlider
        label={label}
        shortLabel={shortLabel}
        {...(title === undefined ? {} : { title })}
        value={value}
        {...range}
        maximum={name === "ior" ? 3 : range.maximum}
        step={0.001}
        scale="linear"
        onChange={change}
      />
    );
  return (
    <LabeledColor
      label={label}
      shortLabel={shortLabel}
      value={value}
      initial={null}
      onChange={(color) => change(color.map((channel) => Math.min(channel, range.maximum)) as Rgb)}
    />
  );
}

/** Color and intensity of the light that the surfaces emit; none if the scene has no such light. */
function EmissionRows({ material }: { material: string }) {
  const emitter = meshLightOf(look.value?.lights ?? {}, material);
  if (emitter === null) return null;
  const { name, light } = emitter;
  return (
    <section aria-label="Emission">
      <LabeledColor
        label="Emission"
        shortLabel="Emission"
        quantity
        value={light.emission}
        initial={null}
        onChange={(emission) => editValue("Emission", jsonPointer("lights", name, "emission"), emission)}
      />
      <LabeledSlider
        label="Emission intensity"
        shortLabel="Intensity"
        value={light.intensity}
        initial={1}
        minimum={0.01}
        maximum={100}
        scale="log"
        unit="×"
        onChange={(value) => editValue("Intensity", jsonPointer("lights", name, "intensity"), value)}
      />
    </section>
  );
}

export function PrincipledView({ material, materialLook }: Props) {
  const reading = useReading({ material, materialLook });
  const edited = editedParameters.value;
  if (reading === null) return <p class="aside">Reading the material…</p>;
  if (typeof reading === "string") return <p class="aside">The material can’t be read: {reading}</p>;
  if (reading.reason !== null)
    return (
      <div class="principled" role="status">
        <p class="aside">{closestText(reading.reason, reading.error)}</p>
        <button onClick={() => replaceByClosest(material, reading)}>Replace by the closest</button>
      </div>
    );
  const parameters = edited?.material === material ? edited.parameters : reading.parameters;
  return (
    <div class="card principled">
      {GROUPS.map(({ title, controls }) => (
        <section key={title} aria-label={title}>
          {controls
            .filter((control) => isShown(control, parameters, materialLook))
            .map((control) => (
              <ControlRow key={control.name} control={control} parameters={parameters} />
            ))}
        </section>
      ))}
      <EmissionRows material={material} />
    </div>
  );
}
