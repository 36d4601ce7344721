/** A light group in the mixer: a collapsible list of its lights with one fader, tint, switch and solo. */
import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { MAX_LIGHT_NAME, type LightGroupLook } from "../../look.gen";
import { fromHex, toHex } from "../../render/color/colorMath";
import { beginDrag } from "../../session/prepare";
import { foldedSections, toggleFolded } from "../../state/panels";
import { groupSource, soloLight, toggleLightSolo } from "../../state/visibility/soloSources";
import { EditableName } from "../../ui/EditableName";
import { IconButton } from "../../ui/IconButton";
import { Slider } from "../../ui/Slider";
import { DRAGGED_LIGHT } from "./LightRow";
import { dissolveGroup, editGroup, groupPath, moveToGroup, renameGroup } from "./lightGroups";

interface Props {
  name: string;
  group: LightGroupLook;
  /** The list shows what was searched, so the group is open. */
  isFiltered: boolean;
  /** The rows of its lights. */
  children: ComponentChildren;
}

export function LightGroupRow({ name, group, isFiltered, children }: Props) {
  const [target, setTarget] = useState(false);
  const section = `light group ${name}`;
  const open = isFiltered || !foldedSections.value.includes(section);
  const drop = (event: DragEvent) => {
    setTarget(false);
    const light = event.dataTransfer?.getData(DRAGGED_LIGHT);
    if (light) moveToGroup(light, name);
  };
  return (
    <li class={`light-group ${target ? "target" : ""}`}>
      <div
        class={`light ${group.enabled ? "" : "off"}`}
        role="group"
        aria-label={`Light group ${name}`}
        onDragOver={(event) => {
          if (!event.dataTransfer?.types.includes(DRAGGED_LIGHT)) return;
          event.preventDefault();
          setTarget(true);
        }}
        onDragLeave={() => setTarget(false)}
        onDrop={drop}
      >
        <IconButton
          icon="light"
          label={`${group.enabled ? "Mute" : "Unmute"} group ${name}`}
          pressed={group.enabled}
          onClick={() => editGroup(group.enabled ? "Mute" : "Unmute", name, "enabled", !group.enabled)}
        />
        <span class="group-name">
          <button
            class="fold"
            aria-expanded={open}
            aria-label={`Lights of ${name}`}
            onClick={() => toggleFolded(section)}
          >
            <span aria-hidden="true">{open ? "▾" : "▸"}</span>
          </button>
          <EditableName
            key={name}
            class="name"
            name={name}
            maximum={MAX_LIGHT_NAME}
            onRename={(next) => renameGroup(name, next)}
          />
          <span class="count">{group.lights.length}</span>
        </span>
        <input
          type="color"
          aria-label={`Group ${name}: tint`}
          title="Tint"
          value={toHex(group.color)}
          onInput={(event) => editGroup("Tint", name, "color", fromHex(event.currentTarget.value, group.color))}
        />
        <IconButton
          icon="solo"
          label={`Solo group ${name}`}
          pressed={soloLight.value === groupSource(name)}
          onClick={() => toggleLightSolo(groupSource(name))}
        />
        <Slider
          label={`Group ${name}: intensity`}
          value={group.intensity}
          initial={1}
          minimum={0.01}
          maximum={100}
          scale="log"
          unit="×"
          onChange={(value) => editGroup("Intensity", name, "intensity", value)}
          onHold={() => beginDrag(groupPath(name))}
        />
        <IconButton icon="trash" label={`Dissolve group ${name}`} onClick={() => dissolveGroup(name)} />
      </div>
      {open && <ul class="lights">{children}</ul>}
    </li>
  );
}
