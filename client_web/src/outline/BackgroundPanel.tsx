/** What is seen behind the objects: the map, the map out of focus, a colour, or nothing. */
import { edit } from "../edit/edit";
import { RANGES } from "../look.gen";
import type { Background } from "../protocol";
import { defaultLook, look } from "../state/look";
import { LabelledColor } from "../ui/LabelledColor";
import { LabelledSlider } from "../ui/LabelledSlider";
import { RadioRow, type Choice } from "../ui/RadioRow";
import { Section } from "../ui/Section";

const KINDS: readonly Choice<Background["kind"]>[] = [
  { value: "map", label: "Map", title: "The environment, sharp" },
  { value: "blurred", label: "Blurred", title: "The environment, out of focus" },
  { value: "color", label: "Colour", title: "One colour" },
  { value: "transparent", label: "None", title: "Nothing: PNG and EXR are transparent there" },
];

function choose(kind: Background["kind"]): void {
  const chosen = KINDS.find((each) => each.value === kind);
  edit(`Background · ${chosen?.label.toLowerCase() ?? kind}`, "/background/kind", kind);
}

export function BackgroundPanel() {
  const shown = look.value?.background;
  const initial = defaultLook.value?.background;
  if (shown === undefined || initial === undefined) return null;
  return (
    <Section title="Background">
      <RadioRow label="Background" choices={KINDS} chosen={shown.kind} onChoose={choose} />
      {shown.kind === "blurred" && (
        <LabelledSlider
          shown="Blur"
          label="Background blur"
          value={shown.blur}
          initial={initial.blur}
          {...RANGES.background.blur}
          scale="log"
          unit="°"
          onChange={(value) => edit("Background blur", "/background/blur", value)}
        />
      )}
      {shown.kind === "color" && (
        <LabelledColor
          shown="Colour"
          label="Background colour"
          value={shown.color}
          initial={initial.color}
          onChange={(value) => edit("Background colour", "/background/color", value)}
        />
      )}
      <p class="environment-words">Only what is seen behind the objects. The light on them stays.</p>
    </Section>
  );
}
