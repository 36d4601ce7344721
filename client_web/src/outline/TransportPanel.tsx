/** Which light paths are shown, of a bake that has light between surfaces. */
import { DEFAULTS, RANGES } from "../look.gen";
import { PATHS } from "../seen/pathWords";
import { seePaths, shownPaths } from "../seen/paths";
import { axes } from "../state/bakes";
import { defaultLook } from "../state/look";
import { LabelledSlider } from "../ui/LabelledSlider";
import { RadioRow } from "../ui/RadioRow";
import { Section } from "../ui/Section";

export function TransportPanel() {
  const transport = shownPaths.value;
  if (transport === null || !axes.value.includes("bounces")) return null;
  return (
    <Section title="Light paths">
      <RadioRow
        label="Light paths"
        choices={PATHS}
        chosen={transport.show}
        onChoose={(show) => seePaths({ ...transport, show })}
      />
      <LabelledSlider
        title="How many surfaces light may meet before the one that is seen"
        label="Bounces"
        value={transport.bounces}
        initial={defaultLook.value?.transport.bounces ?? DEFAULTS.transport.bounces}
        {...RANGES.transport.bounces}
        step={1}
        scale="linear"
        onChange={(bounces) => seePaths({ ...transport, bounces })}
      />
    </Section>
  );
}
