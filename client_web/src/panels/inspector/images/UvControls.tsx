/** Scale, rotation and offset of all images of a material. */
import { editValue } from "../../../edit/edit";
import type { MaterialLook } from "../../../protocol";
import { jsonPointer } from "../../../state/document/pointer";
import { LabeledSlider } from "../../../ui/LabeledSlider";
import { Section } from "../../../ui/Section";
import { IDENTITY, uvOf, withUv, type UvTransform } from "./uv";

interface Props {
  material: string;
  materialLook: MaterialLook;
}

const AXES = ["U", "V"] as const;

export function UvControls({ material, materialLook }: Props) {
  const uv = uvOf(materialLook);
  const edit = (label: string, change: Partial<UvTransform>) =>
    editValue(label, jsonPointer("materials", material), withUv(materialLook, change));
  const pair = (values: UvTransform["scale"], axis: number, value: number): UvTransform["scale"] =>
    axis === 0 ? [value, values[1]] : [values[0], value];
  return (
    <Section title="Texture placement">
      {AXES.map((name, axis) => (
        <LabeledSlider
          key={`scale ${name}`}
          label={`Texture scale ${name}`}
          shortLabel={`Scale ${name}`}
          title="How often the images repeat"
          value={Math.abs(uv.scale[axis] ?? 1)}
          initial={1}
          minimum={0.01}
          maximum={100}
          scale="log"
          onChange={(value) =>
            edit(`Texture scale ${name}`, { scale: pair(uv.scale, axis, (uv.scale[axis] ?? 1) < 0 ? -value : value) })
          }
        />
      ))}
      <LabeledSlider
        label="Texture rotation"
        shortLabel="Rotation"
        value={uv.rotation}
        initial={IDENTITY.rotation}
        unit="°"
        minimum={-180}
        maximum={180}
        step={1}
        scale="linear"
        onChange={(rotation) => edit("Texture rotation", { rotation })}
      />
      {AXES.map((name, axis) => (
        <LabeledSlider
          key={`offset ${name}`}
          label={`Texture offset ${name}`}
          shortLabel={`Offset ${name}`}
          value={uv.offset[axis] ?? 0}
          initial={0}
          minimum={-1}
          maximum={1}
          step={0.01}
          scale="linear"
          onChange={(value) => edit(`Texture offset ${name}`, { offset: pair(uv.offset, axis, value) })}
        />
      ))}
    </Section>
  );
}
