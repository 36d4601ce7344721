/** A light in the mixer: on/off, solo, intensity and tint; it can be dragged onto a group. */
import { useEffect, useRef } from "preact/hooks";
import { fromHex, toHex } from "../../render/color/colorMath";
import { beginDrag } from "../../session/prepare";
import type { Light } from "../../protocol";
import { soloLight, toggleLightSolo } from "../../state/visibility/soloSources";
import { defaultLook } from "../../state/look";
import { isMatchOpen } from "../../state/match";
import { selectedLight, selectLight } from "../../state/selection";
import { IconButton } from "../../ui/IconButton";
import { Slider } from "../../ui/Slider";
import { labelOf } from "./lightKinds";
import { editLight, lightPath } from "./lightEdits";
import { isLinked, linkText } from "./links";
import { MatchLock } from "./MatchLock";

/** Type of the dragged data: the name of a light. */
export const DRAGGED_LIGHT = "application/x-relume-light";

const linkTitle = (light: Light) =>
  `Lights: ${linkText(light.link ?? null)}. Shadows: ${linkText(light.shadow_link ?? null)}.`;

export function LightRow({ name, light }: { name: string; light: Light }) {
  const selected = name === selectedLight.value;
  const row = useRef<HTMLLIElement>(null);
  useEffect(() => {
    if (selected) row.current?.scrollIntoView({ block: "nearest" }); // a new light may be out of view
  }, [selected]);
  return (
    <li
      ref={row}
      class={`light ${selected ? "selected" : ""} ${light.enabled ? "" : "off"} ${isMatchOpen.value ? "lockable" : ""}`}
      draggable
      onDragStart={(event) => event.dataTransfer?.setData(DRAGGED_LIGHT, name)}
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
