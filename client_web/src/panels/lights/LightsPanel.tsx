/** The light mixer: light groups with their lights, then the other lights. */
import { useState } from "preact/hooks";
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
import { filterRows } from "./lightFilter";
import { groupByPrefix, lightGroups } from "./lightGroups";
import { isAddMenuOpen, placingKind, startPlacement, stopPlacement } from "./placement";

const TITLE = "Lights";
const MIN_FILTERED_LIGHTS = 12; // fewer are visible at once

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
  const [text, setText] = useState("");
  const names = Object.keys(lights.value);
  const canFilter = names.length >= MIN_FILTERED_LIGHTS;
  const filter = canFilter ? text.trim() : "";
  const rows = filterRows(lightGroups.value, names, filter);
  return (
    <Section title={TITLE} count={names.length} actions={<LightActions />}>
      {isAddMenuOpen.value && <LightKindMenu />}
      {names.length === 0 && look.value !== null && !isAddMenuOpen.value && (
        <p class="environment-text">No lights yet. Click + to add one.</p>
      )}
      {canFilter && (
        <input
          class="light-filter"
          type="search"
          placeholder="Find"
          aria-label="Find lights"
          value={text}
          onInput={(event) => setText(event.currentTarget.value)}
        />
      )}
      <ul class="lights">
        {rows.groups.map(({ name, group, shown }) => (
          <LightGroupRow key={`group ${name}`} name={name} group={group} isFiltered={filter !== ""}>
            {shown.map((light) => rowOf(light))}
          </LightGroupRow>
        ))}
        {rows.lights.map((name) => rowOf(name))}
      </ul>
      {filter !== "" && rows.groups.length + rows.lights.length === 0 && (
        <p class="environment-text" role="status">
          No light or group is named like “{filter}”.
        </p>
      )}
    </Section>
  );
}
