/** Active filters of the image: labels with actions that clear them. */
import { computed } from "@preact/signals";
import { defaultLook, look } from "../look";
import { pathFilterText } from "./pathLabels";
import { pathOverride, setVisiblePaths, visiblePaths } from "./lightPaths";
import { lightsOfSource, sourceLabel, soloMaterial, soloLight } from "./soloSources";

export interface ActiveFilter {
  label: string;
  /** Tooltip of the clear action. */
  title: string;
  clear: () => void;
}

function resetLightPaths(): void {
  const initial = defaultLook.peek()?.transport;
  if (initial !== undefined) setVisiblePaths(initial);
}

/** True if a solo light or a light-path filter hides part of the look's light. */
export function isLookFiltered(): boolean {
  return soloLight.peek() !== null || pathOverride.peek() !== null;
}

/** Light filters, which affect the server's images and thus exports. */
export const lightFilters = computed<ActiveFilter[]>(() => {
  const filters: ActiveFilter[] = [];
  if (look.value === null || visiblePaths.value === null) return filters;
  const paths = pathFilterText(visiblePaths.value);
  if (paths !== null) filters.push({ label: paths, title: "Show all light", clear: resetLightPaths });
  const source = soloLight.value;
  if (source !== null && lightsOfSource(look.value, source) !== null) {
    const label = `Solo: ${sourceLabel(look.value, source)}`;
    filters.push({ label, title: "Show all lights", clear: () => (soloLight.value = null) });
  }
  return filters;
});

/** Light filters and the solo material, which only affects the display. */
export const activeFilters = computed<ActiveFilter[]>(() => {
  if (soloMaterial.value === null) return lightFilters.value;
  const materialFilter = {
    label: `Solo: ${soloMaterial.value}`,
    title: "Show all materials (S)",
    clear: () => (soloMaterial.value = null),
  };
  return [...lightFilters.value, materialFilter];
});

/** Text such as " (direct light only)" if a light filter is active. */
export function lightFilterText(): string {
  const text = lightFilters.value.map((limit) => limit.label).join(", ");
  return text === "" ? "" : ` (${text.charAt(0).toLowerCase()}${text.slice(1)})`;
}
