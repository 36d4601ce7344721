/** The light mixer: light groups with their lights, then the other lights. */
import { handlesOpen } from "../../state/display";
import { look } from "../../state/look";
import { foldedSections, toggleFolded } from "../../state/panels";
import { IconButton } from "../../ui/IconButton";
import { Section } from "../../ui/Section";
import { ToggleButton } from "../../ui/ToggleButton";
import { LightGroupRow } from "./LightGroupRow";
import { LightRow } from "./LightRow";
import { LIGHT_KINDS } from "./lightKinds";
import { lights } from "./lightEdits";
import { groupByPrefix, groupOfLight, lightGroups } from "./lightGroups";
import { isAddMenuOpen, placingKind, startPlacement, stopPlacement } from "./placement";

const TITLE = "Lights";

function LightKindMenu() {
  return (
    <div class="light-kinds" role="group" aria-label="Light type">
      {LIGHT_KINDS.map(({ kind, label, help }) => (
        <button key={kind} title={help} aria-pressed={placingKind.value === kind} onClick={() => startPlacement(kind)}>
          {label}
        </button>
      ))}
    </div>
  );
}

function LightActions() {
  const toggle = () => {
    if (isAddMenuOpen.value) return stopPlacement();
    isAddMenuOpen.value = true;
    if (foldedSections.value.includes(TITLE)) toggleFolded(TITLE);
  };
  const movable = Object.values(lights.value).some((light) => "position" in light || "direction" in light);
  return (
    <>
      {movable && <ToggleButton icon="handles" label="Light handles" keys="G" state={handlesOpen} />}
      {Object.keys(lights.value).length > 1 && (
        <IconButton icon="grid" label="Group lights by name" onClick={groupByPrefix} />
      )}
      <IconButton icon="plus" label="Add light" pressed={isAddMenuOpen.value} onClick={toggle} />
    </>
  );
}

function rowOf(name: string) {
  const light = lights.value[name];
  return light !== undefined && <LightRow key={name} name={name} light={light} />;
}

export function LightsPanel() {
  const all = Object.entries(lights.value);
  return (
    <Section title={TITLE} count={all.length} actions={<LightActions />}>
      {isAddMenuOpen.value && <LightKindMenu />}
      {all.length === 0 && look.value !== null && !isAddMenuOpen.value && (
        <p class="environment-text">No lights yet. Click + to add one.</p>
      )}
      <ul class="lights">
        {Object.entries(lightGroups.value).map(([name, group]) => (
          <LightGroupRow key={`group ${name}`} name={name} group={group}>
            {group.lights.map((light) => rowOf(light))}
          </LightGroupRow>
        ))}
        {all.map(([name]) => !groupOfLight.value.has(name) && rowOf(name))}
      </ul>
    </Section>
  );
}
