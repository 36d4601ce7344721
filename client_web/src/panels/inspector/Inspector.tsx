/** Inspector of the selected light, or of the selected material with one card per term. */
import { jsonPointer } from "../../state/document/pointer";
import { editValue } from "../../edit/edit";
import { history } from "../../edit/history";
import { BaseColorImage } from "./images/BaseColorImage";
import { EmissionImage } from "./images/EmissionImage";
import { MetalnessImage } from "./images/MetalnessImage";
import { NormalImage } from "./images/NormalImage";
import { hasImages } from "./images/uv";
import { UvControls } from "./images/UvControls";
import { openLibrary } from "../library/libraryItems";
import { LightInspector } from "./lights/LightInspector";
import { openLight } from "../lights/lightEdits";
import { MAX_TERMS } from "../../look.gen";
import { defaultLook, look } from "../../state/look";
import { materialMode } from "../../state/panels";
import { shownPanels } from "../../state/panelWidths";
import { materialOf, models } from "../../state/scene";
import {
  selectedCurve,
  selectedLight,
  selectedMaterial,
  selectedMaterials,
  selectedTerm,
  selectedTerms,
} from "../../state/selection";
import type { Term } from "../../protocol";
import { IconButton } from "../../ui/IconButton";
import { RadioRow, type RadioOption } from "../../ui/RadioRow";
import { Section } from "../../ui/Section";
import { AlbedoInfo } from "./AlbedoInfo";
import { GlassControls } from "./glass/GlassControls";
import { ObjectMaterials } from "./ObjectMaterials";
import { PrincipledView } from "./principled/PrincipledView";
import { TermCard } from "./TermCard";
import { BasisFunctions } from "./ZernikeFit";
import { defaultTerm, isMirror, LIGHT_VIEW, lightViewTerm, modelsFor } from "./terms";

const MODES: readonly RadioOption<"principled" | "terms">[] = [
  { value: "principled", label: "Principled", title: "Base color, metallic, roughness, coat, sheen" },
  { value: "terms", label: "Terms", title: "The layers, with their models and curves" },
];

function replaceTerms(label: string, material: string, next: unknown): void {
  history.endGesture();
  editValue(label, jsonPointer("materials", material, "terms"), next);
}

function newTerm(name: string): Term | null {
  if (name === LIGHT_VIEW.name) return lightViewTerm(models.value);
  const model = models.value.find((m) => m.model === name);
  return model === undefined ? null : defaultTerm(model);
}

function AddTerm({ material }: { material: string }) {
  return (
    <select
      class="add-term"
      aria-label="Add a layer"
      value=""
      disabled={selectedTerms.value.length >= MAX_TERMS}
      onChange={(event) => {
        const added = newTerm(event.currentTarget.value);
        if (added !== null) replaceTerms("Add layer", material, [...selectedTerms.value, added]);
        event.currentTarget.value = "";
      }}
    >
      <option value="">+ Add a layer…</option>
      {modelsFor(null, models.value).map((m) => (
        <option key={m.model} value={m.model}>
          {m.label}
        </option>
      ))}
      <option value={LIGHT_VIEW.name}>{LIGHT_VIEW.label}</option>
    </select>
  );
}

/** Note about focused light, which no method computes. */
function CausticsNote({ material, terms }: { material: string; terms: readonly Term[] }) {
  if (materialOf(material)?.is_glass !== true && !terms.some(isMirror)) return null;
  return <p class="aside">Light that glass or a curved mirror focuses (caustics) isn’t computed.</p>;
}

/** Makes a ground plane a shadow catcher, which shows the background darkened by shadows, or a visible surface. */
function ShadowCatcherToggle({ material }: { material: string }) {
  const catcher = look.value?.materials[material]?.shadow_catcher;
  if (catcher === undefined) return null;
  return (
    <div class="catcher">
      <label>
        <input
          type="checkbox"
          checked={catcher}
          onChange={(event) => {
            const only = event.currentTarget.checked;
            editValue(
              only ? "Shadow catcher on" : "Shadow catcher off",
              jsonPointer("materials", material, "shadow_catcher"),
              only,
            );
          }}
        />
        Shadow catcher
      </label>
      {catcher && (
        <p>
          Shows only the shadows, over the background. Turn it off to see and edit the material; indirect light still
          includes it.
        </p>
      )}
    </div>
  );
}

export function Inspector() {
  const [light, displayedMaterial] = [openLight.value, selectedLight.value];
  if (light !== null && displayedMaterial !== null)
    return <LightInspector key={displayedMaterial} name={displayedMaterial} light={light} />;
  return <MaterialInspector />;
}

function MaterialInspector() {
  const material = selectedMaterial.value;
  if (material === null || selectedTerms.value.length === 0) {
    return (
      <div class="panel inspector">
        <header class="panel-head">
          <h2>Material</h2>
          <button aria-pressed={shownPanels.value.includes("library")} onClick={() => void openLibrary()}>
            Library
          </button>
        </header>
        <p class="hint">Click an object or pick a material to edit it.</p>
      </div>
    );
  }
  const original = defaultLook.value?.materials[material];
  const materialLook = look.value?.materials[material];
  const isShadowCatcher = materialLook?.shadow_catcher === true;
  const isPrincipled = !isShadowCatcher && materialMode.value === "principled" && materialLook !== undefined;
  const showsTerms = !isShadowCatcher && !isPrincipled;
  return (
    <div class="panel inspector">
      <header class="panel-head">
        <h2 class="spacer">{material}</h2>
        <button aria-pressed={shownPanels.value.includes("library")} onClick={() => void openLibrary()}>
          Library
        </button>
        <IconButton
          icon="reset"
          label="Reset material"
          disabled={original === undefined || original === materialLook}
          onClick={() => editValue("Reset material", jsonPointer("materials", material), original)}
        />
      </header>
      {selectedMaterials.value.length > 1 && (
        <p class="aside">
          {selectedMaterials.value.length} materials selected. Colors and parameters change in all that have them.
        </p>
      )}
      <ShadowCatcherToggle material={material} />
      {!isShadowCatcher && (
        <RadioRow
          label="Show the material as"
          choices={MODES}
          selected={materialMode.value}
          onSelect={(mode) => (materialMode.value = mode)}
        />
      )}
      <CausticsNote material={material} terms={selectedTerms.value} />
      {!isShadowCatcher && <BaseColorImage key={material} material={material} terms={selectedTerms.value} />}
      {isPrincipled && <PrincipledView key={material} material={material} materialLook={materialLook} />}
      {showsTerms &&
        selectedTerms.value.map((term, index) => (
          <TermCard
            key={index}
            material={material}
            term={term}
            index={index}
            onRemove={
              selectedTerms.value.length > 1
                ? () => {
                    selectedCurve.value = null;
                    selectedTerm.value = 0;
                    replaceTerms(
                      "Remove layer",
                      material,
                      selectedTerms.value.filter((_, i) => i !== index),
                    );
                  }
                : null
            }
          />
        ))}
      {showsTerms && materialLook !== undefined && (
        <GlassControls material={material} materialLook={materialLook} original={original} />
      )}
      {!isShadowCatcher && <AlbedoInfo key={material} terms={selectedTerms.value} />}
      {showsTerms && <AddTerm material={material} />}
      {showsTerms && materialLook !== undefined && <BasisFunctions material={material} materialLook={materialLook} />}
      {!isShadowCatcher && materialLook !== undefined && (
        <Section title="Metalness, normals, emission">
          <MetalnessImage material={material} terms={selectedTerms.value} />
          <NormalImage
            material={material}
            materialLook={materialLook}
            mirrors={materialOf(material)?.terms.some(isMirror) === true}
          />
          {materialLook.base == null && <EmissionImage material={material} />}
        </Section>
      )}
      {!isShadowCatcher && materialLook !== undefined && hasImages(materialLook, materialOf(material)) && (
        <UvControls material={material} materialLook={materialLook} />
      )}
      {materialLook !== undefined && <ObjectMaterials name={material} material={materialLook} />}
    </div>
  );
}
