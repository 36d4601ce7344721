/** Which light paths are shown, of a bake that has light between surfaces. */
import { seePaths, shownPaths } from "../state/paths";
import { defaultLook, method } from "../state/store";
import { LabelledSlider } from "../ui/LabelledSlider";
import { onRadioKey } from "../ui/radio";
import { Section } from "../ui/Section";
import { MAX_BOUNCES, PATHS, type Show } from "./paths";

export function TransportPanel() {
  const transport = shownPaths.value;
  if (transport === null || method.value !== "gather") return null;
  const choose = (show: Show) => seePaths({ ...transport, show });
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
        onChange={(bounces) => seePaths({ ...transport, bounces })}
      />
    </Section>
  );
}
