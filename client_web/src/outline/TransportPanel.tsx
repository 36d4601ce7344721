/** Which light paths are shown, of a bake that has light between surfaces. */
import { seePaths, shownPaths } from "../state/paths";
import { defaultLook, method } from "../state/store";
import { LabelledSlider } from "../ui/LabelledSlider";
import { RadioRow } from "../ui/RadioRow";
import { Section } from "../ui/Section";
import { MAX_BOUNCES, PATHS } from "./paths";

export function TransportPanel() {
  const transport = shownPaths.value;
  if (transport === null || method.value !== "gather") return null;
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
