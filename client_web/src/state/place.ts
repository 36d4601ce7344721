/** Where the user is, kept so that a reload comes back to it: scene, bake, views and selection in the URL; look and zoom
 * in the tab's own storage. */
import { effect } from "@preact/signals";
import type { Transform } from "../picture/transform";
import type { Look } from "../protocol";
import * as store from "./store";
import { placeToUrl } from "./url";

interface Kept {
  look: Look;
  /** Where each view's picture lies, alone and beside others. */
  alone: [view: string, transform: Transform][];
  beside: [view: string, transform: Transform][];
}

const keptKey = (scene: string) => `relume.scene.${scene}`;

export function recall(scene: string): Kept | null {
  try {
    return JSON.parse(sessionStorage.getItem(keptKey(scene)) ?? "null") as Kept | null;
  } catch {
    return null;
  }
}

function remember(): void {
  const [scene, look] = [store.scene.value, store.look.value];
  if (store.page.value !== "editor" || scene === null || look === null) return;
  const kept: Kept = { look, alone: [...store.alonePlaces.value], beside: [...store.besidePlaces.value] };
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
      beside: store.sideBySide.value ? store.shownViews.value : [],
      material: store.selectedMaterial.value,
      term: store.selectedTerm.value,
      curve: store.selectedCurve.value,
      light: store.selectedLight.value,
    });
    window.history.replaceState(null, "", url);
  });
  window.addEventListener("pagehide", remember);
  document.addEventListener("visibilitychange", remember);
}
