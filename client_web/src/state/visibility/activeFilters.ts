/** Active filters of the image as labels, each with an action that clears it. */
import { computed } from "@preact/signals";
import { defaultLook, look } from "../look";
import { pathFilterText } from "./pathLabels";
import { pathOverride, setVisiblePaths, visiblePaths } from "./lightPaths";
import { hasLightSource, soloMaterial, soloLight } from "./soloSources";

export interface ActiveFilter {
  label: string;
  /** What lifting it does. */
  title: string;
  clear(): void;
}

function resetLightPaths(): void {
  const initial = defaultLook.peek()?.transport;
  if (initial !== undefined) setVisiblePaths(initial);
}

/** Whether light of the look is left out now: one light alone is no image of a look, nor are some of its paths. */
export function isLookFiltered(): boolean {
  return soloLight.peek() !== null || pathOverride.peek() !== null;
}

/** Of light: what is missing in the images of the server, so in exported ones too. */
export const lightFilters = computed<ActiveFilter[]>(() => {
  const filters: ActiveFilter[] = [];
  if (look.value === null || visiblePaths.value === null) return filters;
  const paths = pathFilterText(visiblePaths.value);
  if (paths !== null) filters.push({ label: paths, title: "Show all light again", clear: resetLightPaths });
  const source = soloLight.value;
  if (source !== null && hasLightSource(look.value, source)) {
    const label = `Only the light of ${source || "the environment"}`;
    filters.push({ label, title: "Show all lights again", clear: () => (soloLight.value = null) });
  }
  return filters;
});

/** Of light, and of materials, which only the screen grays out. */
export const activeFilters = computed<ActiveFilter[]>(() => {
  if (soloMaterial.value === null) return lightFilters.value;
  const materialFilter = { label: `Only ${soloMaterial.value}`, title: "Show all materials again (S)", clear: () => (soloMaterial.value = null) };
  return [...lightFilters.value, materialFilter];
});

/** ": only direct light" where the images of the server leave something out. */
export function lightFilterText(): string {
  const text = lightFilters.value.map((limit) => limit.label).join(", ");
  return text === "" ? "" : `: ${text.charAt(0).toLowerCase()}${text.slice(1)}`;
}
