/** What is in the scene: materials to select, the lights and the light around them. */
import { useEffect } from "preact/hooks";
import { toHex } from "../color/color";
import { isSame } from "../document/difference";
import { LightsPanel } from "../lights/LightsPanel";
import { measuredThumbnail } from "../net/api";
import type { MaterialLook } from "../protocol";
import { solo, toggleMaterialSolo } from "../seen/solo";
import { defaultLook, look } from "../state/look";
import { materialNames, modelOf } from "../state/scene";
import { mayEdit } from "../state/me";
import { hoveredMaterial, select, selectedMaterial } from "../state/selection";
import { IconButton } from "../ui/Button";
import { Section } from "../ui/Section";
import { followBalls, shownBalls } from "./balls";
import { BackgroundPanel } from "./BackgroundPanel";
import { EnvironmentPanel } from "./EnvironmentPanel";
import { TransportPanel } from "./TransportPanel";

/** A ball of the material; until it is rendered one in its colors: body from its diffuse term, highlight from the rest. Of
 * what was measured its picture. */
function Swatch({ name, material }: { name: string; material: MaterialLook | undefined }) {
  const terms = material?.terms ?? [];
  const ball = shownBalls.value.get(name);
  if (ball !== undefined) return <span class="swatch" style={{ background: `url(${ball}) center / 130%` }} />;
  const measured = terms.find((term) => term.data != null)?.data;
  if (measured != null) return <span class="swatch" style={{ background: `url(${measuredThumbnail(measured)}) center / 130%` }} />;
  const diffuse = terms.find((term) => modelOf(term)?.texture === "diffuse");
  const glossy = terms.find((term) => modelOf(term)?.texture !== "diffuse");
  const body = diffuse === undefined ? "#1c1c1c" : toHex(diffuse.color);
  const light = glossy === undefined ? body : toHex(glossy.color);
  return (
    <span
      class="swatch"
      style={{ background: `radial-gradient(circle at 35% 30%, ${light} 4%, ${body} 48%, #111 130%)` }}
    />
  );
}

function Materials() {
  const move = (event: KeyboardEvent) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    const items = [...(event.currentTarget as HTMLElement).querySelectorAll<HTMLElement>("[role=option]")];
    items[
      Math.min(items.length - 1, Math.max(0, items.indexOf(document.activeElement as HTMLElement) + step))
    ]?.focus();
  };
  const focusable = selectedMaterial.value ?? materialNames.value[0];
  return (
    <div
      class="materials"
      role="listbox"
      aria-label="Materials"
      onKeyDown={move}
      onPointerLeave={() => (hoveredMaterial.value = null)}
    >
      {materialNames.value.map((name) => {
        const material = look.value?.materials[name];
        const changed =
          look.value !== null &&
          !isSame(material, defaultLook.value?.materials[name]);
        return (
          <button
            key={name}
            role="option"
            tabIndex={name === focusable ? 0 : -1}
            aria-selected={name === selectedMaterial.value}
            class={name === hoveredMaterial.value ? "hovered" : ""}
            onPointerEnter={() => (hoveredMaterial.value = name)}
            onFocus={(event) => (hoveredMaterial.value = event.currentTarget.matches(":focus-visible") ? name : null)}
            onBlur={() => (hoveredMaterial.value = null)}
            onClick={() => select(name)}
          >
            <Swatch name={name} material={material} />
            <span class="name" title={name}>
              {name}
            </span>
            {changed && <span class="dot" title="Changed" aria-label="changed" />}
          </button>
        );
      })}
    </div>
  );
}

function SoloButton() {
  const selected = selectedMaterial.value;
  return (
    <IconButton
      icon="solo"
      label={selected === null ? "Select a material to show it alone" : `Show ${selected} alone`}
      keys="S"
      pressed={solo.value !== null}
      disabled={selected === null && solo.value === null}
      onClick={toggleMaterialSolo}
    />
  );
}

export function Outline() {
  useEffect(followBalls, []);
  return (
    <nav class="panel outline" aria-label="Scene">
      <Section title="Materials" count={materialNames.value.length} actions={<SoloButton />}>
        <Materials />
      </Section>
      <div inert={!mayEdit.value}>
        <LightsPanel />
        <EnvironmentPanel />
        <BackgroundPanel />
      </div>
      <TransportPanel />
    </nav>
  );
}
