/** The chosen color of the canvases: of this browser, not of the look. */
import { computed, signal } from "@preact/signals";
import {
  availableColor,
  HIGH_RANGE_QUERY,
  readAbilities,
  WIDE_GAMUT_QUERY,
  type CanvasAbilities,
  type CanvasColor,
} from "../render/color/canvasColor";

const COLOR_KEY = "relume.canvasColor";

export const canvasAbilities = signal<CanvasAbilities>(readAbilities({}, () => false));
export const canvasColorChoice = signal<CanvasColor>(loadChoice());
/** The choice, as far as browser and screen have it. */
export const canvasColor = computed(() => availableColor(canvasColorChoice.value, canvasAbilities.value));

function loadChoice(): CanvasColor {
  try {
    const stored = localStorage.getItem(COLOR_KEY);
    return stored === "display-p3" || stored === "hdr" ? stored : "srgb";
  } catch {
    return "srgb"; // no storage
  }
}

export function chooseCanvasColor(color: CanvasColor): void {
  canvasColorChoice.value = color;
  try {
    localStorage.setItem(COLOR_KEY, color);
  } catch {
    // no storage: a reload starts with sRGB
  }
}

/** Read the abilities, and again when the window moves to another screen. */
export function watchCanvasAbilities(context: object, media: (query: string) => MediaQueryList): void {
  const read = () => (canvasAbilities.value = readAbilities(context, (query) => media(query).matches));
  for (const query of [WIDE_GAMUT_QUERY, HIGH_RANGE_QUERY]) media(query).addEventListener("change", read);
  read();
}
