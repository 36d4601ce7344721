/** Which light paths are shown, of a bake that has light between surfaces. */
import { edit } from "../state/edit";
import { defaultLook, look, method } from "../state/store";
import { LabelledSlider } from "../ui/LabelledSlider";
import { onRadioKey } from "../ui/radio";
import { Section } from "../ui/Section";
import { MAX_BOUNCES, PATHS, type Show } from "./paths";

function choose(show: Show): void {
  edit("Light paths", "/transport/show", show);
}

export function TransportPanel() {
  const transport = look.value?.transport;
  if (transport === undefined || method.value !== "gather") return null;
  const chosen = PATHS.findIndex(({ show }) => show === transport.show);
  return (
    <Section title="Light paths">
      <div
        class="group segmented"
        role="radiogroup"
        aria-label="Light paths"
        onKeyDown={(event) => onRadioKey(event, PATHS.length, chosen, (index) => choose(PATHS[index]?.show ?? "all"))}
      >
        {PATHS.map(({ show, label, title }, index) => (
          <button
            key={show}
            role="radio"
            aria-checked={index === chosen}
            tabIndex={index === chosen ? 0 : -1}
            title={title}
            onClick={() => choose(show)}
          >
            {label}
          </button>
        ))}
      </div>
      <LabelledSlider
        title="How many surfaces light may meet before the one that is seen"
        label="Bounces"
        value={transport.bounces}
        initial={defaultLook.value?.transport.bounces ?? MAX_BOUNCES}
        minimum={0}
        maximum={MAX_BOUNCES}
        step={1}
        scale="linear"
        onChange={(bounces) => edit("Bounces", "/transport/bounces", bounces)}
      />
    </Section>
  );
}
