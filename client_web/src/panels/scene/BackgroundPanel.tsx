/** The background: the environment map, the map out of focus, a color, or nothing. */
import { editValue } from "../../edit/edit";
import { RANGES } from "../../look.gen";
import type { Background } from "../../protocol";
import { defaultLook, look } from "../../state/look";
import { LabeledColor } from "../../ui/LabeledColor";
import { LabeledSlider } from "../../ui/LabeledSlider";
import { RadioRow, type RadioOption } from "../../ui/RadioRow";
import { Section } from "../../ui/Section";

const KINDS: readonly RadioOption<Background["kind"]>[] = [
  { value: "map", label: "Map", title: "The environment, sharp" },
  { value: "blurred", label: "Blurred", title: "The environment, out of focus" },
  { value: "color", label: "Colour", title: "One colour" },
  { value: "transparent", label: "None", title: "Nothing: PNG and EXR are transparent there" },
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
          shortLabel="Colour"
          label="Background colour"
          value={background.color}
          initial={initial.color}
          onChange={(value) => editValue("Background colour", "/background/color", value)}
        />
      )}
      <p class="environment-words">Only what is seen behind the objects. The light on them stays.</p>
    </Section>
  );
}
