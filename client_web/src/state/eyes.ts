/** Where hands have put the eyes of the open scene's views: each bake of it, also one that is on its way, is seen from there. */
import type { HelloMessage } from "../protocol";
import { scene } from "./scene";

export interface Placed {
  camera: HelloMessage["views"][number]["camera"];
  /** Of the picture, pixels. */
  size: [width: number, height: number];
}

const placed = new Map<string, Placed>();

const keyOf = (view: string) => JSON.stringify([scene.peek()?.id, view]);

/** Null where a view's eye is where it began, in a picture as large as was baked. */
export const placedEye = (view: string): Placed | null => placed.get(keyOf(view)) ?? null;

export function placeEye(view: string, of: Placed | null): void {
  if (of === null) placed.delete(keyOf(view));
  else placed.set(keyOf(view), of);
}
