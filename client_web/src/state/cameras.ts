/** Placed cameras of the open scene's views: each bake of it, also a pending one, is rendered from there. */
import type { HelloMessage } from "../protocol";
import { scene } from "./scene";

export interface PlacedCamera {
  camera: HelloMessage["views"][number]["camera"];
  /** Of the image, pixels. */
  size: [width: number, height: number];
}

const placedCameras = new Map<string, PlacedCamera>();

const cameraKey = (view: string) => JSON.stringify([scene.peek()?.id, view]);

/** Null where a view's camera is where it began, in an image as large as was baked. */
export const placedCameraOf = (view: string): PlacedCamera | null => placedCameras.get(cameraKey(view)) ?? null;

export function storeCamera(view: string, pose: PlacedCamera | null): void {
  if (pose === null) placedCameras.delete(cameraKey(view));
  else placedCameras.set(cameraKey(view), pose);
}
