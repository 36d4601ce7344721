/** Which panels have room beside the picture: where a window is narrow, those that were opened longest ago fold away, and
 * come back when there is room again. */
import { computed, effect, signal, type Signal } from "@preact/signals";
import { commentsOpen, inspectorOpen, inspectorWidth, libraryOpen, outlineOpen, truthOpen } from "./panels";

export type SidePanel = "outline" | "library" | "truth" | "comments" | "inspector";

const LEAST_PICTURE = 240;
const SPLITTER = 5;
export const INSPECTOR = { narrowest: 288, widest: 720 };
const OPEN: Record<SidePanel, Signal<boolean>> = {
  outline: outlineOpen,
  library: libraryOpen,
  truth: truthOpen,
  comments: commentsOpen,
  inspector: inspectorOpen,
};

/** CSS pixels. */
export const windowWidth = signal(Infinity);

/** A width that the inspector may have in this window. */
export function inspectorWidthIn(window: number, wanted: number): number {
  const { narrowest, widest } = INSPECTOR;
  return Math.round(Math.min(widest, Math.max(narrowest, Math.min(wanted, window * 0.55))));
}

export const inspectorShownWidth = computed(() => inspectorWidthIn(windowWidth.value, inspectorWidth.value));

const between = (least: number, most: number, share: number) =>
  Math.round(Math.min(most, Math.max(least, share * windowWidth.value)));

/** CSS pixels. */
export const panelWidths = computed<Record<SidePanel, number>>(() => ({
  outline: 250,
  library: between(280, 400, 0.24),
  truth: between(280, 480, 0.26),
  comments: between(240, 340, 0.2),
  inspector: inspectorShownWidth.value + SPLITTER,
}));

/** Of panels, newest first, those that fit into `room`; the newest is always among them. */
export function fittingPanels<Name extends string>(newest: readonly Name[], widths: Record<Name, number>, room: number): Name[] {
  let left = room;
  const shown: Name[] = [];
  for (const name of newest) {
    if (shown.length > 0 && widths[name] > left) break;
    left -= widths[name];
    shown.push(name);
  }
  return shown;
}

/** What was opened last comes first. */
const order = signal<readonly SidePanel[]>([]);

function toFront(name: SidePanel): void {
  order.value = [name, ...order.peek().filter((other) => other !== name)];
}

export const shownPanels = computed(() =>
  fittingPanels(
    order.value.filter((name) => OPEN[name].value),
    panelWidths.value,
    windowWidth.value - LEAST_PICTURE,
  ),
);

/** Close a panel that is seen; else open it, in the place of others where there is no room for all. */
export function togglePanel(name: SidePanel): void {
  const seen = shownPanels.peek().includes(name);
  OPEN[name].value = !seen;
  if (!seen) toFront(name);
}

/** Follow the window, and what is opened. */
export function followRoom(): void {
  for (const name of Object.keys(OPEN) as SidePanel[]) {
    effect(() => {
      if (OPEN[name].value) toFront(name);
    });
  }
  const measure = () => (windowWidth.value = window.innerWidth);
  measure();
  window.addEventListener("resize", measure);
}
