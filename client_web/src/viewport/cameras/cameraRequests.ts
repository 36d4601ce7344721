/** REST calls for a scene's cameras and its placement viewport. */
import { getJson, json, request } from "../../session/net/api";
import type { CameraEntry, PathBody, PickBody, Triple, ViewportBody } from "../../protocol";
import type { BakeSize } from "../../session/scene/recipe";
import type { CameraPose } from "./orbit";

export const MAX_NAME = 80;

const cameraUrl = (scene: string) => `/api/scenes/${encodeURIComponent(scene)}`;
const namedCameraUrl = (scene: string, name: string) => `${cameraUrl(scene)}/cameras/${encodeURIComponent(name)}`;

export const listCameras = (scene: string) => getJson<CameraEntry[]>(`${cameraUrl(scene)}/cameras`);
export const getPlacementView = (scene: string) => getJson<ViewportBody>(`${cameraUrl(scene)}/viewport`);

export async function saveCamera(scene: string, name: string, camera: CameraPose): Promise<void> {
  const { to_world, yfov, near = 0, lens = null } = camera;
  await request(namedCameraUrl(scene, name), json("PUT", { to_world, yfov, near, lens }));
}

export async function deleteCamera(scene: string, name: string): Promise<void> {
  await request(namedCameraUrl(scene, name), { method: "DELETE" });
}

export async function renderPlacement(scene: string, camera: CameraPose, size: BakeSize): Promise<Blob> {
  return (await request(`${cameraUrl(scene)}/viewport`, json("POST", { ...camera, size }))).blob();
}

/** The surface point that a pixel shows; null for the background. */
export async function pickTarget(
  scene: string,
  { to_world, yfov, near = 0 }: CameraPose,
  size: BakeSize,
  x: number,
  y: number,
): Promise<Triple | null> {
  const answer = await request(`${cameraUrl(scene)}/viewport/pick`, json("POST", { to_world, yfov, near, size, x, y }));
  return ((await answer.json()) as PickBody).position as Triple | null;
}

/** The first surface on a path. */
export async function tracePlacementPath(scene: string, points: readonly Triple[]): Promise<PathBody> {
  return (await request(`${cameraUrl(scene)}/viewport/path`, json("POST", { points }))).json() as Promise<PathBody>;
}

/** The first unused name of "View 1", "View 2", … */
export function nextCameraName(usedNames: readonly string[]): string {
  for (let number = 1; ; number++) if (!usedNames.includes(`View ${number}`)) return `View ${number}`;
}
