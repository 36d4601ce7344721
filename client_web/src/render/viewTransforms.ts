/** Zoom transforms: each view has one for showing it alone and one for the grid. */
import { signal } from "@preact/signals";
import { sideBySide } from "../state/views";
import { FIT, type ZoomTransform } from "./zoomTransform";

/** Transforms alone and in the grid; fitted by default. */
export const singleTransforms = signal<ReadonlyMap<string, ZoomTransform>>(new Map());
export const gridTransforms = signal<ReadonlyMap<string, ZoomTransform>>(new Map());

const activeTransforms = () => (sideBySide.value ? gridTransforms : singleTransforms);

export function transformOf(view: string): ZoomTransform {
  return activeTransforms().value.get(view) ?? FIT;
}

export function setTransform(view: string, transform: ZoomTransform): void {
  const table = activeTransforms();
  table.value = new Map(table.peek()).set(view, transform);
}
