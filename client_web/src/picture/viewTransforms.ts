/** Where each view's picture lies on its canvas: every view has its own place, and another one beside others. */
import { signal } from "@preact/signals";
import { sideBySide } from "../state/views";
import { FIT, type Transform } from "./transform";

/** Of the views when they are alone, and when they are beside others; fitted where nothing is said. */
export const aloneTransforms = signal<ReadonlyMap<string, Transform>>(new Map());
export const besideTransforms = signal<ReadonlyMap<string, Transform>>(new Map());

const shownTransforms = () => (sideBySide.value ? besideTransforms : aloneTransforms);

export function transformOf(view: string): Transform {
  return shownTransforms().value.get(view) ?? FIT;
}

export function moveTo(view: string, transform: Transform): void {
  const table = shownTransforms();
  table.value = new Map(table.peek()).set(view, transform);
}
