/** Which views are shown, and which of them the hand is in. */
import { batch, computed, signal } from "@preact/signals";
import { MAX_VIEWS_SHOWN, type HelloMessage } from "../protocol";

/** Those that the shown bake has. */
export const views = signal<HelloMessage["views"]>([]);
/** The active view: what buttons and keys mean. It is one of those that are shown. */
export const viewName = signal("");
export const shownViews = signal<string[]>([]);
export const sideBySide = computed(() => shownViews.value.length > 1);
/** The view that the pointer is over. */
export const pointedView = signal<string | null>(null);
/** The view whose frames go first. */
export const focusedView = computed(() => {
  const pointed = pointedView.value;
  return pointed !== null && shownViews.value.includes(pointed) ? pointed : viewName.value;
});
export const view = computed(() => views.value.find((v) => v.name === viewName.value) ?? null);

/** As many views as fit, in their order, the active one among them. */
export function sideBySideOf(all: readonly string[], active: string): string[] {
  const first = all.slice(0, MAX_VIEWS_SHOWN);
  return first.includes(active) || !all.includes(active) ? first : [...first.slice(0, -1), active];
}

/** Of the views that are to be shown those that there are; where there are none, one. */
export function availableOf(wanted: readonly string[], all: readonly string[], one: string): string[] {
  const found = wanted.filter((name) => all.includes(name)).slice(0, MAX_VIEWS_SHOWN);
  return found.length > 0 ? found : [one];
}

/** Show a view alone. */
export function showAlone(name: string): void {
  batch(() => {
    shownViews.value = [name];
    viewName.value = name;
    pointedView.value = null;
  });
}

export function toggleSideBySide(): void {
  if (sideBySide.value) return showAlone(viewName.value);
  if (views.value.length < 2) return;
  shownViews.value = sideBySideOf(
    views.value.map((view) => view.name),
    viewName.value,
  );
}

/** Work in this view from now on: what buttons and keys mean. */
export function workIn(name: string): void {
  if (shownViews.peek().includes(name)) viewName.value = name;
}

/** Whether the eye of a shown view moves. */
export const moves = computed(() => views.value.some(({ name, eye }) => eye === "free" && shownViews.value.includes(name)));
