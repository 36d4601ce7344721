/** The light mixer: on/off, solo, intensity and tint of each light. */
import { useEffect, useRef } from "preact/hooks";
import { fromHex, toHex } from "../../render/color/colorMath";
import { beginDrag } from "../../session/prepare";
import type { Light } from "../../protocol";
import { soloLight, toggleLightSolo } from "../../state/visibility/soloSources";
import { handlesOpen } from "../../state/display";
import { defaultLook, look } from "../../state/look";
import { foldedSections, toggleFolded } from "../../state/panels";
import { selectedLight, selectLight } from "../../state/selection";
import { IconButton } from "../../ui/IconButton";
import { Section } from "../../ui/Section";
import { Slider } from "../../ui/Slider";
import { ToggleButton } from "../../ui/ToggleButton";
import { LIGHT_KINDS, labelOf } from "./lightKinds";
import { editLight, lightPath, lights } from "./lightEdits";
import { MatchLock } from "./match/MatchLock";
import { isMatchOpen } from "./match/match";
import { isLinked, linkText } from "./links";
import { isAddMenuOpen, placingKind, startPlacement, stopPlacement } from "./placement";

const TITLE = "Lights";

const linkTitle = (light: Light) =>
  `Lights: ${linkText(light.link ?? null)}. Shadows: ${linkText(light.shadow_link ?? null)}.`;

function LightRow({ name, light }: { name: string; light: Light }) {
  const selected = name === selectedLight.value;
  const row = useRef<HTMLLIElement>(null);
  useEffect(() => {
    if (selected) row.current?.scrollIntoView({ block: "nearest" }); // a new light may be out of view
  }, [selected]);
  return (
    <li
      ref={row}
      class={`light ${selected ? "selected" : ""} ${light.enabled ? "" : "off"} ${isMatchOpen.value ? "lockable" : ""}`}
    >
      <IconButton
        icon="light"
        label={`Turn ${light.enabled ? "off" : "on"} ${name}`}
        pressed={light.enabled}
        onClick={() => editLight(light.enabled ? "Turn off" : "Turn on", name, "enabled", !light.enabled)}
      />
      <button
        class="name"
        title={`${name}: ${labelOf(light.kind)}`}
        aria-pressed={selected}
        onClick={() => selectLight(selected ? null : name)}
      >
        {name}
        {isLinked(light) && (
          <small class="linked" title={linkTitle(light)} aria-label="linked">
            {" "}
            ⚯
          </small>
        )}
      </button>
      <input
        type="color"
        aria-label={`${name}: tint`}
        title="Tint"
        value={toHex(light.color)}
        onInput={(event) => editLight("Tint", name, "color", fromHex(event.currentTarget.value, light.color))}
      />
      <IconButton
        icon="solo"
        label={`Solo ${name}`}
        pressed={soloLight.value === name}
        onClick={() => toggleLightSolo(name)}
      />
      {isMatchOpen.value && <MatchLock label={name} pointer={lightPath(name)} />}
      <Slider
        label={`${name}: intensity`}
        value={light.intensity}
        initial={defaultLook.value?.lights[name]?.intensity ?? 1}
        minimum={0.01}
        maximum={100}
        scale="log"
        unit="×"
        onChange={(value) => editLight("Intensity", name, "intensity", value)}
        onHold={() => beginDrag(lightPath(name))}
      />
    </li>
  );
}

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
  const movable = Object.values(lights.value).some(({ kind }) => kind !== "mesh");
  return (
    <>
      {movable && <ToggleButton icon="handles" label="Light handles" keys="G" state={handlesOpen} />}
      <IconButton icon="plus" label="Add light" pressed={isAddMenuOpen.value} onClick={toggle} />
    </>
  );
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
        {all.map(([name, light]) => (
          <LightRow key={name} name={name} light={light} />
        ))}
      </ul>
    </Section>
  );
}
