/** Color, absorption, roughness and index of refraction of a material that transmits light. */
import { editValue } from "../../../edit/edit";
import { RANGES, type GlassLook } from "../../../look.gen";
import type { MaterialLook } from "../../../protocol";
import { materialOf } from "../../../state/scene";
import { jsonPointer } from "../../../state/document/pointer";
import { LabeledColor } from "../../../ui/LabeledColor";
import { LabeledSlider } from "../../../ui/LabeledSlider";
import { Section } from "../../../ui/Section";
import { withGlass } from "./glass";

interface Props {
  material: string;
  materialLook: MaterialLook;
  original: MaterialLook | undefined;
}

export function GlassControls({ material, materialLook, original }: Props) {
  const glass = materialLook.glass ?? null;
  const initial = original?.glass ?? glass;
  if (glass === null || initial === null)
    return materialOf(material)?.is_glass === true ? (
      <p class="aside">An earlier version made this bake. Bake the scene again to edit what its glass transmits.</p>
    ) : null;
  const edit = (label: string, change: Partial<GlassLook>) =>
    editValue(label, jsonPointer("materials", material), withGlass(materialLook, change));
  return (
    <Section title="Glass">
      <LabeledColor
        label="Glass color"
        shortLabel="Color"
        value={glass.color}
        initial={initial.color}
        onChange={(color) => edit("Glass color", { color: color.map((c) => Math.min(c, 1)) as GlassLook["color"] })}
      />
      {glass.absorption !== undefined && (
        <LabeledColor
          label="Absorption per meter"
          shortLabel="Absorption"
          quantity
          value={glass.absorption}
          initial={initial.absorption ?? null}
          onChange={(absorption) => edit("Absorption", { absorption })}
        />
      )}
      <LabeledSlider
        label="Glass roughness"
        shortLabel="Roughness"
        title="Blurs what is behind the glass, from 0.05 on"
        value={glass.roughness}
        initial={initial.roughness}
        {...RANGES.glass.roughness}
        step={0.01}
        scale="linear"
        onChange={(roughness) => edit("Glass roughness", { roughness })}
      />
      <LabeledSlider
        label="Index of refraction"
        shortLabel="IOR"
        value={glass.ior}
        initial={initial.ior}
        {...RANGES.glass.ior}
        maximum={3}
        step={0.01}
        scale="linear"
        onChange={(ior) => edit("Index of refraction", { ior })}
      />
      <p class="aside">
        The color of what is behind the glass changes at once. Its shadows, blur and refraction follow when you stop
        editing; while a free camera moves, only its color is followed.
      </p>
    </Section>
  );
}
