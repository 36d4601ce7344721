/** The shown views, and the active one. */
import { batch, computed, signal } from "@preact/signals";
import { MAX_VISIBLE_VIEWS, type HelloMessage } from "../protocol";

/** The views of the shown bake. */
export const views = signal<HelloMessage["views"]>([]);
/** The active view, used by buttons and keys; always one of the shown views. */
export const activeViewName = signal("");
export const shownViews = signal<string[]>([]);
export const sideBySide = computed(() => shownViews.value.length > 1);
/** The view under the pointer. */
export const hoveredView = signal<string | null>(null);
/** The view whose frames have priority. */
export const focusedView = computed(() => {
  const pointed = hoveredView.value;
  return pointed !== null && shownViews.value.includes(pointed) ? pointed : activeViewName.value;
});
export const activeView = computed(() => views.value.find((v) => v.name === activeViewName.value) ?? null);

/** As many views as fit, in order, including the active one. */
export function chooseSideBySide(all: readonly string[], active: string): string[] {
  const first = all.slice(0, MAX_VISIBLE_VIEWS);
  return first.includes(active) || !all.includes(active) ? first : [...first.slice(0, -1), active];
}

/** The existing views among the requested ones; one view if there are none. */
export function availableViews(requested: readonly string[], all: readonly string[], fallback: string): string[] {
  const available = requested.filter((name) => all.includes(name)).slice(0, MAX_VISIBLE_VIEWS);
  return available.length > 0 ? available : [fallback];
}

/** Show a view alone. */
export function showSingleView(name: string): void {
  batch(() => {
    shownViews.value = [name];
    activeViewName.value = name;
    hoveredView.value = null;
  });
}

export function toggleSideBySide(): void {
  if (sideBySide.value) return showSingleView(activeViewName.value);
  if (views.value.length < 2) return;
  shownViews.value = chooseSideBySide(
    views.value.map((view) => view.name),
    activeViewName.value,
  );
}

/** Make a view the active one. */
export function setFocus(name: string): void {
  if (shownViews.peek().includes(name)) activeViewName.value = name;
}

/** True if a shown view has a free camera. */
export const hasFreeCamera = computed(() =>
  views.value.some(({ name, camera_mode: cameraMode }) => cameraMode === "free" && shownViews.value.includes(name)),
);
