/** Filter of the displayed light paths, for bakes with indirect light. */
import { DEFAULTS, RANGES } from "../../look.gen";
import { LIGHT_PATHS } from "../../state/visibility/pathLabels";
import { setVisiblePaths, visiblePaths } from "../../state/visibility/lightPaths";
import { axes } from "../../state/bakes";
import { defaultLook } from "../../state/look";
import { LabeledSlider } from "../../ui/LabeledSlider";
import { RadioRow } from "../../ui/RadioRow";
import { Section } from "../../ui/Section";

export function TransportPanel() {
  const transport = visiblePaths.value;
  if (transport === null || !axes.value.includes("bounces")) return null;
  return (
    <Section title="Light paths">
      <RadioRow
        label="Light paths"
        choices={LIGHT_PATHS}
        selected={transport.show}
        onSelect={(show) => setVisiblePaths({ ...transport, show })}
      />
      <LabeledSlider
        title="Maximum number of bounces"
        label="Bounces"
        value={transport.bounces}
        initial={defaultLook.value?.transport.bounces ?? DEFAULTS.transport.bounces}
        {...RANGES.transport.bounces}
        step={1}
        scale="linear"
        onChange={(bounces) => setVisiblePaths({ ...transport, bounces })}
      />
    </Section>
  );
}
