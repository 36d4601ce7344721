/** Placed cameras of the open scene's views, used for all its bakes, including a pending one. */
import { signal } from "@preact/signals";
import type { HelloMessage } from "../protocol";
import { scene } from "./scene";

/** True while a free camera moves. */
export const isCameraMoving = signal(false);

export interface PlacedCamera {
  camera: HelloMessage["views"][number]["camera"];
  /** Image size in pixels. */
  size: [width: number, height: number];
}

const placedCameras = new Map<string, PlacedCamera>();

const cameraKey = (view: string) => JSON.stringify([scene.peek()?.id, view]);

/** Null if a view has its initial camera and the baked image size. */
export const placedCameraOf = (view: string): PlacedCamera | null => placedCameras.get(cameraKey(view)) ?? null;

export function storeCamera(view: string, pose: PlacedCamera | null): void {
  if (pose === null) placedCameras.delete(cameraKey(view));
  else placedCameras.set(cameraKey(view), pose);
}
