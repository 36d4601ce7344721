/** Which views are shown, and which of them has the focus. */
import { batch, computed, signal } from "@preact/signals";
import { MAX_VISIBLE_VIEWS, type HelloMessage } from "../protocol";

/** Those that the shown bake has. */
export const views = signal<HelloMessage["views"]>([]);
/** The active view: what buttons and keys mean. It is one of those that are shown. */
export const activeViewName = signal("");
export const shownViews = signal<string[]>([]);
export const sideBySide = computed(() => shownViews.value.length > 1);
/** The view that the pointer is over. */
export const hoveredView = signal<string | null>(null);
/** The view whose frames go first. */
export const focusedView = computed(() => {
  const pointed = hoveredView.value;
  return pointed !== null && shownViews.value.includes(pointed) ? pointed : activeViewName.value;
});
export const activeView = computed(() => views.value.find((v) => v.name === activeViewName.value) ?? null);

/** As many views as fit, in their order, the active one among them. */
export function chooseSideBySide(all: readonly string[], active: string): string[] {
  const first = all.slice(0, MAX_VISIBLE_VIEWS);
  return first.includes(active) || !all.includes(active) ? first : [...first.slice(0, -1), active];
}

/** Of the views that are to be shown those that there are; where there are none, one. */
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

/** Work in this view from now on: what buttons and keys mean. */
export function setFocus(name: string): void {
  if (shownViews.peek().includes(name)) activeViewName.value = name;
}

/** Whether the camera of a shown view moves. */
export const hasFreeCamera = computed(() => views.value.some(({ name, camera_mode: cameraMode }) => cameraMode === "free" && shownViews.value.includes(name)));
