/** Which panels fit beside the image: in a narrow window, the least recently opened ones are hidden until they fit
 * again. */
import { computed, effect, signal, type Signal } from "@preact/signals";
import { commentsOpen, inspectorOpen, inspectorWidth, libraryOpen, scenePanelOpen, comparisonOpen } from "./panels";

export type SidePanel = "outline" | "library" | "comparison" | "comments" | "inspector";

const MIN_VIEWPORT_WIDTH = 240;
const SPLITTER_WIDTH = 5;
export const INSPECTOR_RANGE = { narrowest: 288, widest: 720 };
const PANEL_SIGNALS: Record<SidePanel, Signal<boolean>> = {
  outline: scenePanelOpen,
  library: libraryOpen,
  comparison: comparisonOpen,
  comments: commentsOpen,
  inspector: inspectorOpen,
};

/** CSS pixels. */
export const windowWidth = signal(Infinity);

/** Clamp the inspector's width for this window. */
export function clampInspectorWidth(window: number, requested: number): number {
  const { narrowest, widest } = INSPECTOR_RANGE;
  return Math.round(Math.min(widest, Math.max(narrowest, Math.min(requested, window * 0.55))));
}

export const inspectorShownWidth = computed(() => clampInspectorWidth(windowWidth.value, inspectorWidth.value));

const clampShareOfWindow = (minimum: number, maximum: number, fraction: number) =>
  Math.round(Math.min(maximum, Math.max(minimum, fraction * windowWidth.value)));

/** CSS pixels. */
export const panelWidths = computed<Record<SidePanel, number>>(() => ({
  outline: 250,
  library: clampShareOfWindow(280, 400, 0.24),
  comparison: clampShareOfWindow(280, 480, 0.26),
  comments: clampShareOfWindow(240, 340, 0.2),
  inspector: inspectorShownWidth.value + SPLITTER_WIDTH,
}));

/** The panels that fit into `available`, newest first; always includes the newest. */
export function fittingPanels<Name extends string>(
  newest: readonly Name[],
  widths: Record<Name, number>,
  available: number,
): Name[] {
  let remaining = available;
  const fitting: Name[] = [];
  for (const name of newest) {
    if (fitting.length > 0 && widths[name] > remaining) break;
    remaining -= widths[name];
    fitting.push(name);
  }
  return fitting;
}

/** Most recently opened first. */
const panelOrder = signal<readonly SidePanel[]>([]);

function bringToFront(name: SidePanel): void {
  panelOrder.value = [name, ...panelOrder.peek().filter((panel) => panel !== name)];
}

export const shownPanels = computed(() =>
  fittingPanels(
    panelOrder.value.filter((name) => PANEL_SIGNALS[name].value),
    panelWidths.value,
    windowWidth.value - MIN_VIEWPORT_WIDTH,
  ),
);

/** Close a visible panel; else open it, replacing others if they do not all fit. */
export function togglePanel(name: SidePanel): void {
  const isShown = shownPanels.peek().includes(name);
  PANEL_SIGNALS[name].value = !isShown;
  if (!isShown) bringToFront(name);
}

/** Track the window's width and opened panels. */
export function trackPanelWidths(): void {
  for (const name of Object.keys(PANEL_SIGNALS) as SidePanel[]) {
    effect(() => {
      if (PANEL_SIGNALS[name].value) bringToFront(name);
    });
  }
  const measure = () => (windowWidth.value = window.innerWidth);
  measure();
  window.addEventListener("resize", measure);
}
