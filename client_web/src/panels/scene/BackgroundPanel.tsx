/** The background: the environment map, the blurred map, a color, or transparent. */
import { editValue } from "../../edit/edit";
import { RANGES } from "../../look.gen";
import type { Background } from "../../protocol";
import { defaultLook, look } from "../../state/look";
import { LabeledColor } from "../../ui/LabeledColor";
import { LabeledSlider } from "../../ui/LabeledSlider";
import { RadioRow, type RadioOption } from "../../ui/RadioRow";
import { Section } from "../../ui/Section";

const KINDS: readonly RadioOption<Background["kind"]>[] = [
  { value: "map", label: "HDRI", title: "The environment map, sharp" },
  { value: "blurred", label: "Blurred", title: "The environment map, out of focus" },
  { value: "color", label: "Color", title: "A single color" },
  { value: "transparent", label: "Transparent", title: "PNG and EXR exports have an alpha channel" },
];

function chooseBackground(kind: Background["kind"]): void {
  const selectedKind = KINDS.find((candidate) => candidate.value === kind);
  editValue(`Background · ${selectedKind?.label.toLowerCase() ?? kind}`, "/background/kind", kind);
}

export function BackgroundPanel() {
  const background = look.value?.background;
  const initial = defaultLook.value?.background;
  if (background === undefined || initial === undefined) return null;
  return (
    <Section title="Background">
      <RadioRow label="Background" choices={KINDS} selected={background.kind} onSelect={chooseBackground} />
      {background.kind === "blurred" && (
        <LabeledSlider
          shortLabel="Blur"
          label="Background blur"
          value={background.blur}
          initial={initial.blur}
          {...RANGES.background.blur}
          scale="log"
          unit="°"
          onChange={(value) => editValue("Background blur", "/background/blur", value)}
        />
      )}
      {background.kind === "color" && (
        <LabeledColor
          shortLabel="Color"
          label="Background color"
          value={background.color}
          initial={initial.color}
          onChange={(value) => editValue("Background color", "/background/color", value)}
        />
      )}
      <p class="environment-text">Changes the background only, not the lighting.</p>
    </Section>
  );
}
