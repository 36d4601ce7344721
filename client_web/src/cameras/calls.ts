/** Cameras of a scene over REST, and its picture in plain colours from anywhere. */
import { getJson, json, request } from "../net/api";
import type { CameraEntry, FinderBody, PlaceBody, Triple } from "../protocol";
import type { Size } from "../scene/recipe";
import type { Frame } from "./orbit";

export const MAX_NAME = 80;

const of = (scene: string) => `/api/scenes/${encodeURIComponent(scene)}`;
const named = (scene: string, name: string) => `${of(scene)}/cameras/${encodeURIComponent(name)}`;

export const listCameras = (scene: string) => getJson<CameraEntry[]>(`${of(scene)}/cameras`);
export const getFinder = (scene: string) => getJson<FinderBody>(`${of(scene)}/finder`);

export async function keepCamera(scene: string, name: string, { to_world, yfov }: Frame): Promise<void> {
  await request(named(scene, name), json("PUT", { to_world, yfov }));
}

export async function deleteCamera(scene: string, name: string): Promise<void> {
  await request(named(scene, name), { method: "DELETE" });
}

export async function finderPicture(scene: string, { to_world, yfov }: Frame, size: Size): Promise<Blob> {
  return (await request(`${of(scene)}/finder`, json("POST", { to_world, yfov, size }))).blob();
}

/** The place that a pixel shows; null where that is the background. */
export async function placeAt(
  scene: string,
  { to_world, yfov }: Frame,
  size: Size,
  x: number,
  y: number,
): Promise<Triple | null> {
  const answer = await request(`${of(scene)}/finder/place`, json("POST", { to_world, yfov, size, x, y }));
  return ((await answer.json()) as PlaceBody).position as Triple | null;
}

/** The first of "View 1", "View 2" … that no camera has. */
export function freeName(taken: readonly string[]): string {
  for (let number = 1; ; number++) if (!taken.includes(`View ${number}`)) return `View ${number}`;
}
