/** Which panels are open and how wide they are, and what is chosen in them, kept for the next visit. */
import { effect, signal, type Signal } from "@preact/signals";
import { exrSpace } from "./color";

export const outlineOpen = signal(true);
export const inspectorOpen = signal(true);
/** These are closed again at the next visit. */
export const libraryOpen = signal(false);
export const truthOpen = signal(false);
export const commentsOpen = signal(false);
export const timelineOpen = signal(false);
export const filmstripOpen = signal(true);
export const inspectorWidth = signal(320);
export const histogramOpen = signal(false);
/** Spots and panels go on aiming at the same point while they are moved. */
export const aimLocked = signal(false);
export const helpOpen = signal(false);
/** Titles of the panels' sections that are folded away. */
export const folded = signal<readonly string[]>([]);

export function toggleFolded(title: string): void {
  const others = folded.value.filter((name) => name !== title);
  folded.value = others.length < folded.value.length ? others : [...others, title];
}

const KEPT: Record<string, Signal<unknown>> = {
  outlineOpen,
  inspectorOpen,
  filmstripOpen,
  inspectorWidth,
  histogramOpen,
  aimLocked,
  folded,
  exrSpace,
};
const KEY = "relume.panels";

function recall(): void {
  try {
    const kept = JSON.parse(localStorage.getItem(KEY) ?? "{}") as Record<string, unknown>;
    for (const [name, panel] of Object.entries(KEPT)) {
      const value = kept[name];
      if (typeof value === typeof panel.value && Array.isArray(value) === Array.isArray(panel.value)) panel.value = value;
    }
  } catch {
    // forbidden or not ours: everything is open
  }
}

/** Take up how the panels were left, and keep them in step. */
export function followPanels(): void {
  recall();
  effect(() => {
    const text = JSON.stringify(Object.fromEntries(Object.entries(KEPT).map(([name, panel]) => [name, panel.value])));
    try {
      localStorage.setItem(KEY, text);
    } catch {
      // they are open again next time
    }
  });
}
