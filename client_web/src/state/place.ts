/** Where the user is, kept so that a reload comes back to it: scene, bake, view and selection in the URL; look, zoom
 * and the session's token in the tab's own storage. */
import { effect } from "@preact/signals";
import type { Transform } from "../picture/transform";
import type { Look } from "../protocol";
import { resumeToken } from "./live";
import * as store from "./store";

export interface Place {
  scene: string | null;
  bake: string | null;
  view: string | null;
  material: string | null;
  term: number;
  curve: string | null;
}

export function placeFromUrl(search: string): Place {
  const query = new URLSearchParams(search);
  return {
    scene: query.get("scene"),
    bake: query.get("bake"),
    view: query.get("view"),
    material: query.get("material"),
    term: Math.max(0, Math.trunc(Number(query.get("term") ?? 0)) || 0),
    curve: query.get("curve"),
  };
}

export function placeToUrl(place: Place): string {
  const query = new URLSearchParams();
  for (const key of ["scene", "bake", "view", "material", "curve"] as const) {
    if (place[key] !== null && place[key] !== "") query.set(key, place[key]);
  }
  if (place.material !== null && place.term > 0) query.set("term", String(place.term));
  return query.size > 0 ? `?${query.toString()}` : "/";
}

interface Kept {
  look: Look;
  transform: Transform;
  token: string | null;
  bake: string;
}

const keptKey = (scene: string) => `relume.scene.${scene}`;

export function recall(scene: string): Kept | null {
  try {
    return JSON.parse(sessionStorage.getItem(keptKey(scene)) ?? "null") as Kept | null;
  } catch {
    return null;
  }
}

export function forget(scene: string): void {
  sessionStorage.removeItem(keptKey(scene));
}

function remember(): void {
  const [scene, look, bake] = [store.scene.value, store.look.value, store.bake.value];
  if (store.page.value !== "editor" || scene === null || look === null || bake === null) return;
  const kept: Kept = { look, transform: store.transform.value, token: resumeToken(), bake };
  try {
    sessionStorage.setItem(keptKey(scene.id), JSON.stringify(kept));
  } catch {
    // storage is full or forbidden: a reload then starts from the scene's own look
  }
}

/** Keep URL and storage in step with the editor. */
export function followPlace(): void {
  effect(() => {
    if (store.page.value !== "editor" || store.scene.value === null) return;
    const url = placeToUrl({
      scene: store.scene.value.id,
      bake: store.bake.value,
      view: store.viewName.value,
      material: store.selectedMaterial.value,
      term: store.selectedTerm.value,
      curve: store.selectedCurve.value,
    });
    window.history.replaceState(null, "", url);
  });
  window.addEventListener("pagehide", remember);
  document.addEventListener("visibilitychange", remember);
}
