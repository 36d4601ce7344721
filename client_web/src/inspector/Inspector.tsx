/** What is selected: a light, or a material with its terms as cards. */
import { pointer } from "../document/pointer";
import { edit } from "../edit/edit";
import { history } from "../edit/history";
import { BaseImage } from "../images/BaseImage";
import { MetalImage } from "../images/MetalImage";
import { NormalImage } from "../images/NormalImage";
import { openLibrary } from "../library/library";
import { LightInspector } from "../lights/LightInspector";
import { openLight } from "../lights/lights";
import { MAX_TERMS } from "../look.gen";
import { defaultLook, look } from "../state/look";
import { shownPanels } from "../state/room";
import { materialOf, models } from "../state/scene";
import { selectedCurve, selectedLight, selectedMaterial, selectedTerm, terms } from "../state/selection";
import { IconButton } from "../ui/Button";
import { Section } from "../ui/Section";
import { Energy } from "./Energy";
import { TermCard } from "./TermCard";
import { defaultTerm, isMirror, modelsFor } from "./terms";

function replaceTerms(label: string, material: string, next: unknown): void {
  history.seal();
  edit(label, pointer("materials", material, "terms"), next);
}

function AddTerm({ material }: { material: string }) {
  return (
    <select
      class="add-term"
      aria-label="Add a term"
      value=""
      disabled={terms.value.length >= MAX_TERMS}
      onChange={(event) => {
        const model = models.value.find((m) => m.model === event.currentTarget.value);
        if (model !== undefined) replaceTerms("Add term", material, [...terms.value, defaultTerm(model)]);
        event.currentTarget.value = "";
      }}
    >
      <option value="">+ Add a term…</option>
      {modelsFor(null, models.value).map((m) => (
        <option key={m.model} value={m.model}>
          {m.label}
        </option>
      ))}
    </select>
  );
}

/** A ground shows shadows alone, in front of what is behind it, or is a surface like others. */
function Catcher({ material }: { material: string }) {
  const catcher = look.value?.materials[material]?.catcher;
  if (catcher === undefined) return null;
  return (
    <div class="catcher">
      <label>
        <input
          type="checkbox"
          checked={catcher}
          onChange={(event) => {
            const only = event.currentTarget.checked;
            edit(only ? "Shadows only" : "A surface to see", pointer("materials", material, "catcher"), only);
          }}
        />
        Shadows only
      </label>
      {catcher && (
        <p>
          The background shows through, as dark as the shadows on it. Switch this off to see and change the material
          itself; in reflected light it goes on lighting the objects.
        </p>
      )}
    </div>
  );
}

/** What of glass is edited here, and what is not. */
function Glass({ material }: { material: string }) {
  if (materialOf(material)?.is_glass !== true) return null;
  return <p class="aside">Glass: what it reflects is edited here; what comes through it is as in the scene’s file.</p>;
}

export function Inspector() {
  const [light, shown] = [openLight.value, selectedLight.value];
  if (light !== null && shown !== null) return <LightInspector key={shown} name={shown} light={light} />;
  return <MaterialInspector />;
}

function MaterialInspector() {
  const material = selectedMaterial.value;
  if (material === null || terms.value.length === 0) {
    return (
      <div class="panel inspector">
        <header class="panel-head">
          <h2>Material</h2>
          <button aria-pressed={shownPanels.value.includes("library")} onClick={() => void openLibrary()}>
            Library
          </button>
        </header>
        <p class="hint">
          Click something in the picture, or choose a material on the left, to change how it reflects light.
        </p>
      </div>
    );
  }
  const original = defaultLook.value?.materials[material];
  const shown = look.value?.materials[material];
  const isCaught = shown?.catcher === true;
  return (
    <div class="panel inspector">
      <header class="panel-head">
        <h2 class="spacer">{material}</h2>
        <button aria-pressed={shownPanels.value.includes("library")} onClick={() => void openLibrary()}>
          Library
        </button>
        <IconButton
          icon="reset"
          label="Reset this material"
          disabled={original === undefined || original === shown}
          onClick={() => edit("Reset material", pointer("materials", material), original)}
        />
      </header>
      <Catcher material={material} />
      <Glass material={material} />
      {!isCaught && <BaseImage key={material} material={material} terms={terms.value} />}
      {!isCaught && terms.value.map((term, index) => (
        <TermCard
          key={index}
          material={material}
          term={term}
          index={index}
          onRemove={
            terms.value.length > 1
              ? () => {
                  selectedCurve.value = null;
                  selectedTerm.value = 0;
                  replaceTerms(
                    "Remove term",
                    material,
                    terms.value.filter((_, i) => i !== index),
                  );
                }
              : null
          }
        />
      ))}
      {!isCaught && <Energy key={material} terms={terms.value} />}
      {!isCaught && <AddTerm material={material} />}
      {!isCaught && shown !== undefined && (
        <Section title="Metal and normal maps">
          <MetalImage material={material} terms={terms.value} />
          <NormalImage material={material} of={shown} mirrors={materialOf(material)?.terms.some(isMirror) === true} />
        </Section>
      )}
    </div>
  );
}
