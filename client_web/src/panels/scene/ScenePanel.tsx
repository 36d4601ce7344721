/** The scene's contents: materials, lights, environment, background and light paths. */
import { useEffect } from "preact/hooks";
import { toHex } from "../../render/color/colorMath";
import { isDeepEqual } from "../../state/document/difference";
import { LightsPanel } from "../lights/LightsPanel";
import { measuredThumbnailUrl } from "../../session/net/api";
import type { MaterialLook } from "../../protocol";
import { soloMaterial, toggleMaterialSolo } from "../../state/visibility/soloSources";
import { defaultLook, look } from "../../state/look";
import { shownMaterialNames, modelOf } from "../../state/scene";
import { mayEdit } from "../../state/sessionUser";
import {
  hoveredMaterial,
  selectMaterial,
  selectedMaterial,
  selectedMaterials,
  selectMaterialsTo,
  toggleMaterial,
} from "../../state/selection";
import { IconButton } from "../../ui/IconButton";
import { Section } from "../../ui/Section";
import { copiedMaterial, copyMaterial, pasteMaterial } from "./copyMaterial";
import { watchBalls, displayedBalls } from "./materialBalls";
import { BackgroundPanel } from "./BackgroundPanel";
import { EnvironmentPanel } from "./EnvironmentPanel";
import { TransportPanel } from "./TransportPanel";
import { serverUrl } from "../../session/net/serverUrl";

/** A preview ball of the material; until it is rendered, a gradient of its diffuse and highlight colors. Measured materials
 * show their thumbnail. */
function MaterialSwatch({ name, material }: { name: string; material: MaterialLook | undefined }) {
  const terms = material?.terms ?? [];
  const ball = displayedBalls.value.get(name);
  if (ball !== undefined) return <span class="swatch" style={{ background: `url(${ball}) center / 130%` }} />;
  const measured = terms.find((term) => term.data != null)?.data;
  if (measured != null)
    return (
      <span class="swatch" style={{ background: `url(${serverUrl(measuredThumbnailUrl(measured))}) center / 130%` }} />
    );
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

/** Run a command of the list's keys; false if there is none. */
function runListKey(event: KeyboardEvent): boolean {
  if (!event.ctrlKey && !event.metaKey) return false;
  const focused = (document.activeElement as HTMLElement | null)?.dataset["material"];
  if (event.key === "c") copyMaterial();
  else if (event.key === "v" && mayEdit.value) pasteMaterial();
  else if (event.key === " " && focused !== undefined) toggleMaterial(focused);
  else return false;
  return true;
}

function CopyPaste() {
  const copied = copiedMaterial.value;
  const hasSelection = selectedMaterial.value !== null;
  return (
    <div class="copy-paste" role="group" aria-label="Copy and paste materials">
      <button disabled={!hasSelection} title="Copy the selected material (Ctrl+C in the list)" onClick={copyMaterial}>
        Copy
      </button>
      <button
        disabled={!hasSelection || copied === null || !mayEdit.value}
        title={
          copied === null ? "Copy a material first" : `Paste “${copied.name}” on the selection (Ctrl+V in the list)`
        }
        onClick={pasteMaterial}
      >
        Paste
      </button>
    </div>
  );
}

function MaterialList() {
  const move = (event: KeyboardEvent) => {
    if (runListKey(event)) {
      event.preventDefault();
      event.stopPropagation();
      return;
    }
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    const items = [...(event.currentTarget as HTMLElement).querySelectorAll<HTMLElement>("[role=option]")];
    const index = items.indexOf(document.activeElement as HTMLElement) + step;
    const next = items[Math.min(items.length - 1, Math.max(0, index))];
    next?.focus();
    const name = next?.dataset["material"];
    if (event.shiftKey && name !== undefined) selectMaterialsTo(name, shownMaterialNames.value);
  };
  const focusable = selectedMaterial.value ?? shownMaterialNames.value[0];
  return (
    <div
      class="materials"
      role="listbox"
      aria-label="Materials"
      aria-multiselectable="true"
      title="Ctrl+click or Shift+click selects several"
      onKeyDown={move}
      onPointerLeave={() => (hoveredMaterial.value = null)}
    >
      {shownMaterialNames.value.map((name) => {
        const material = look.value?.materials[name];
        const changed = look.value !== null && !isDeepEqual(material, defaultLook.value?.materials[name]);
        return (
          <button
            key={name}
            role="option"
            tabIndex={name === focusable ? 0 : -1}
            data-material={name}
            aria-selected={selectedMaterials.value.includes(name)}
            class={name === hoveredMaterial.value ? "hovered" : ""}
            onPointerEnter={() => (hoveredMaterial.value = name)}
            onFocus={(event) => (hoveredMaterial.value = event.currentTarget.matches(":focus-visible") ? name : null)}
            onBlur={() => (hoveredMaterial.value = null)}
            onClick={(event) => {
              if (event.ctrlKey || event.metaKey) toggleMaterial(name);
              else if (event.shiftKey) selectMaterialsTo(name, shownMaterialNames.value);
              else selectMaterial(name);
            }}
          >
            <MaterialSwatch name={name} material={material} />
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
      label={selected === null ? "Select a material to solo it" : `Solo ${selected}`}
      keys="S"
      pressed={soloMaterial.value !== null}
      disabled={selected === null && soloMaterial.value === null}
      onClick={toggleMaterialSolo}
    />
  );
}

export function ScenePanel() {
  useEffect(watchBalls, []);
  return (
    <nav class="panel outline" aria-label="Scene">
      <Section title="Materials" count={shownMaterialNames.value.length} actions={<SoloButton />}>
        <MaterialList />
        <CopyPaste />
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
