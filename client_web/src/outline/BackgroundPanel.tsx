/** What is seen behind the objects: the map, the map out of focus, a colour, or nothing. */
import { ColorField } from "../inspector/ColorField";
import type { Background } from "../protocol";
import { edit } from "../state/edit";
import { defaultLook, look } from "../state/store";
import { LabelledSlider } from "../ui/LabelledSlider";
import { onRadioKey } from "../ui/radio";
import { Section } from "../ui/Section";

const KINDS: { kind: Background["kind"]; label: string; title: string }[] = [
  { kind: "map", label: "Map", title: "The environment, sharp" },
  { kind: "blurred", label: "Blurred", title: "The environment, out of focus" },
  { kind: "color", label: "Colour", title: "One colour" },
  { kind: "transparent", label: "None", title: "Nothing: PNG and EXR are transparent there" },
];

function choose(kind: Background["kind"]): void {
  const chosen = KINDS.find((each) => each.kind === kind);
  edit(`Background · ${chosen?.label.toLowerCase() ?? kind}`, "/background/kind", kind);
}

function Kinds({ chosen }: { chosen: number }) {
  return (
    <div
      class="group segmented"
      role="radiogroup"
      aria-label="Background"
      onKeyDown={(event) => onRadioKey(event, KINDS.length, chosen, (index) => choose(KINDS[index]?.kind ?? "map"))}
    >
      {KINDS.map(({ kind, label, title }, index) => (
        <button
          key={kind}
          role="radio"
          aria-checked={index === chosen}
          tabIndex={index === chosen ? 0 : -1}
          title={title}
          onClick={() => choose(kind)}
        >
          {label}
        </button>
      ))}
    </div>
  );
}

export function BackgroundPanel() {
  const shown = look.value?.background;
  const initial = defaultLook.value?.background;
  if (shown === undefined || initial === undefined) return null;
  return (
    <Section title="Background">
      <Kinds chosen={KINDS.findIndex(({ kind }) => kind === shown.kind)} />
      {shown.kind === "blurred" && (
        <LabelledSlider
          shown="Blur"
          label="Background blur"
          value={shown.blur}
          initial={initial.blur}
          minimum={2}
          maximum={60}
          scale="log"
          unit="°"
          onChange={(value) => edit("Background blur", "/background/blur", value)}
        />
      )}
      {shown.kind === "color" && (
        <div class="param alone">
          <span class="param-label">Colour</span>
          <ColorField
            label="Background colour"
            value={shown.color}
            initial={initial.color}
            onChange={(value) => edit("Background colour", "/background/color", value)}
          />
        </div>
      )}
      <p class="environment-words">Only what is seen behind the objects. The light on them stays.</p>
    </Section>
  );
}
