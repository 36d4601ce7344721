/** The lights of the scene as a mixer: each switched on and off, alone, stronger or weaker, and tinted. */
import { useEffect, useRef } from "preact/hooks";
import { fromHex, toHex } from "../color/color";
import { hold } from "../live/touch";
import type { Light } from "../protocol";
import { soloLight, toggleLightSolo } from "../seen/solo";
import { handlesOpen } from "../state/display";
import { defaultLook, look } from "../state/look";
import { folded, toggleFolded } from "../state/panels";
import { selectedLight, selectLight } from "../state/selection";
import { IconButton } from "../ui/Button";
import { Section } from "../ui/Section";
import { Slider } from "../ui/Slider";
import { Switch } from "../ui/Switch";
import { KINDS, labelOf } from "./kinds";
import { editLight, lightPath, lights } from "./lights";
import { adding, placing, startPlacing, stopAdding } from "./placing";

const TITLE = "Lights";

function Row({ name, light }: { name: string; light: Light }) {
  const selected = name === selectedLight.value;
  const row = useRef<HTMLLIElement>(null);
  useEffect(() => {
    if (selected) row.current?.scrollIntoView({ block: "nearest" }); // a new one may be below the fold
  }, [selected]);
  return (
    <li
      ref={row}
      class={`light ${selected ? "selected" : ""} ${light.on ? "" : "off"}`}
    >
      <IconButton
        icon="lamp"
        label={`${name}: ${light.on ? "switch off" : "switch on"}`}
        pressed={light.on}
        onClick={() => editLight(light.on ? "Off" : "On", name, "on", !light.on)}
      />
      <button
        class="name"
        title={`${name}: ${labelOf(light.kind)}`}
        aria-pressed={selected}
        onClick={() => selectLight(selected ? null : name)}
      >
        {name}
      </button>
      <input
        type="color"
        aria-label={`${name}: colour`}
        title="Tint"
        value={toHex(light.color)}
        onInput={(event) => editLight("Tint", name, "color", fromHex(event.currentTarget.value, light.color))}
      />
      <IconButton
        icon="solo"
        label={`${name} alone`}
        pressed={soloLight.value === name}
        onClick={() => toggleLightSolo(name)}
      />
      <Slider
        label={`${name}: intensity`}
        value={light.scale}
        initial={defaultLook.value?.lights[name]?.scale ?? 1}
        minimum={0.01}
        maximum={100}
        scale="log"
        unit="×"
        onChange={(value) => editLight("Intensity", name, "scale", value)}
        onHold={() => hold(lightPath(name))}
      />
    </li>
  );
}

function Kinds() {
  return (
    <div class="light-kinds" role="group" aria-label="Kind of light">
      {KINDS.map(({ kind, label, help }) => (
        <button key={kind} title={help} aria-pressed={placing.value === kind} onClick={() => startPlacing(kind)}>
          {label}
        </button>
      ))}
    </div>
  );
}

function Actions() {
  const toggle = () => {
    if (adding.value) return stopAdding();
    adding.value = true;
    if (folded.value.includes(TITLE)) toggleFolded(TITLE);
  };
  const movable = Object.values(lights.value).some(({ kind }) => kind !== "mesh");
  return (
    <>
      {movable && <Switch icon="handles" label="Handles in the picture" keys="G" of={handlesOpen} />}
      <IconButton icon="plus" label="Add a light" pressed={adding.value} onClick={toggle} />
    </>
  );
}

export function LightsPanel() {
  const all = Object.entries(lights.value);
  return (
    <Section title={TITLE} count={all.length} actions={<Actions />}>
      {adding.value && <Kinds />}
      {all.length === 0 && look.value !== null && !adding.value && <p class="environment-words">None yet; + adds one.</p>}
      <ul class="lights">
        {all.map(([name, light]) => (
          <Row key={name} name={name} light={light} />
        ))}
      </ul>
    </Section>
  );
}
