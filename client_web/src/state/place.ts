/** Where the user is, kept so that a reload comes back to it: scene, bake, views and selection in the URL; look, zoom and
 * history in the tab's own storage. */
import { effect } from "@preact/signals";
import { giveThumbnail, historyThumbnail } from "../looks/strip";
import type { Transform } from "../picture/transform";
import type { Look, Transport } from "../protocol";
import { fromText, toText } from "./journal";
import * as store from "./store";
import { placeToUrl } from "./url";

interface Kept {
  look: Look;
  /** Where each view's picture lies, alone and beside others. */
  alone: [view: string, transform: Transform][];
  beside: [view: string, transform: Transform][];
  /** The material and the source of light that are shown alone, and the light paths that are looked at. */
  solo?: string | null;
  soloLight?: string | null;
  paths?: Transport | null;
}

const keptKey = (scene: string) => `relume.scene.${scene}`;
const HISTORY = "relume.history.";
/** Of a scene's history; a browser gives a tab some millions of characters. */
const MAX_HISTORY_LENGTH = 1 << 20;

export function recall(scene: string): Kept | null {
  try {
    return JSON.parse(sessionStorage.getItem(keptKey(scene)) ?? "null") as Kept | null;
  } catch {
    return null;
  }
}

/** Take up the history that led to this look of a scene, where it was kept. */
export function recallHistory(scene: string, look: Look): void {
  try {
    const text = sessionStorage.getItem(HISTORY + scene);
    const story = text === null ? null : fromText(text, look, giveThumbnail);
    if (story !== null) store.history.restore(story.steps, story.cursor);
  } catch {
    // of an older editor, or forbidden: a new one begins
  }
}

/** Store a text; where there is no room, histories of other scenes make some. */
function keep(key: string, text: string): void {
  try {
    sessionStorage.setItem(key, text);
  } catch {
    for (const other of Object.keys(sessionStorage)) if (other.startsWith(HISTORY)) sessionStorage.removeItem(other);
    sessionStorage.setItem(key, text);
  }
}

export function remember(): void {
  const [scene, look] = [store.scene.value, store.look.value];
  if (store.page.value !== "editor" || scene === null || look === null) return;
  const kept: Kept = {
    look,
    alone: [...store.alonePlaces.value],
    beside: [...store.besidePlaces.value],
    solo: store.solo.value,
    soloLight: store.soloLight.value,
    paths: store.seenPaths.value,
  };
  const story = { steps: store.history.steps.value, cursor: store.history.cursor.value };
  try {
    keep(keptKey(scene.id), JSON.stringify(kept));
    keep(HISTORY + scene.id, toText(story, MAX_HISTORY_LENGTH, historyThumbnail));
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
