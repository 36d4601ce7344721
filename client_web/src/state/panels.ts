/** Open panels, their widths and settings, stored for the next visit. */
import { effect, signal, type Signal } from "@preact/signals";
import { exrSpace } from "./color";

export const scenePanelOpen = signal(true);
export const inspectorOpen = signal(true);
/** Not stored: closed at the next visit. */
export const libraryOpen = signal(false);
export const comparisonOpen = signal(false);
export const commentsOpen = signal(false);
export const timelineOpen = signal(false);
export const filmstripOpen = signal(true);
export const inspectorWidth = signal(320);
export const histogramOpen = signal(false);
export type Scope = "histogram" | "waveform" | "parade";
export const scope = signal<Scope>("histogram");
/** True if spots and panels keep aiming at the same point while moved. */
export const aimLocked = signal(false);
export const helpOpen = signal(false);
/** Mode of the inspector: a material as principled parameters, or as terms. */
export const materialMode = signal<"principled" | "terms">("terms");
/** Titles of collapsed panel sections. */
export const foldedSections = signal<readonly string[]>([]);

export function toggleFolded(title: string): void {
  const remaining = foldedSections.value.filter((name) => name !== title);
  foldedSections.value = remaining.length < foldedSections.value.length ? remaining : [...remaining, title];
}

const STORED_PANELS: Record<string, Signal<unknown>> = {
  outlineOpen: scenePanelOpen,
  inspectorOpen,
  filmstripOpen,
  inspectorWidth,
  histogramOpen,
  scope,
  aimLocked,
  folded: foldedSections,
  materialMode,
  exrSpace,
};
const PANELS_KEY = "relume.panels";

function loadPanels(): void {
  try {
    const stored = JSON.parse(localStorage.getItem(PANELS_KEY) ?? "{}") as Record<string, unknown>;
    for (const [name, panel] of Object.entries(STORED_PANELS)) {
      const value = stored[name];
      if (typeof value === typeof panel.value && Array.isArray(value) === Array.isArray(panel.value))
        panel.value = value;
    }
  } catch {
    // storage is forbidden or invalid: use the defaults
  }
}

/** Load the stored panels, and store their changes. */
export function trackPanels(): void {
  loadPanels();
  effect(() => {
    const text = JSON.stringify(
      Object.fromEntries(Object.entries(STORED_PANELS).map(([name, panel]) => [name, panel.value])),
    );
    try {
      localStorage.setItem(PANELS_KEY, text);
    } catch {
      // storage is forbidden: defaults next time
    }
  });
}
