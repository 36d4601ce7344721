/** Which views are shown, and which of them the hand is in. */
import { batch } from "@preact/signals";
import { MAX_VIEWS_SHOWN } from "../protocol";
import { pointedView, shownViews, sideBySide, viewName, views } from "./store";

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
