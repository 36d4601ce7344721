/** Where the user is, kept so that a reload comes back to it: scene, bake, views and selection in the URL; look, zoom and
 * history in the tab's own storage. */
import { effect } from "@preact/signals";
import { passing } from "../edit/edit";
import { history } from "../edit/history";
import { fromText, toText } from "../edit/journal";
import type { Transform } from "../picture/transform";
import { aloneTransforms, besideTransforms } from "../picture/viewTransforms";
import type { Look, Transport } from "../protocol";
import { seenPaths } from "../seen/paths";
import { solo, soloLight } from "../seen/solo";
import { bake } from "../state/bakes";
import { look } from "../state/look";
import { page, scene } from "../state/scene";
import { selectedCurve, selectedLight, selectedMaterial, selectedTerm } from "../state/selection";
import { door, watching } from "../state/together";
import { giveThumbnail, lookThumbnail } from "../state/thumbnails";
import { shownViews, sideBySide, viewName } from "../state/views";
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
    const story = text === null ? null : fromText(text, door.peek() === null ? look : null, giveThumbnail);
    if (story !== null) history.restore(story.steps, story.cursor);
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
  const [id, current] = [scene.value?.id, passing.value?.before ?? look.value];
  if (page.value !== "editor" || id === undefined || current === null) return;
  const kept: Kept = {
    look: current,
    alone: [...aloneTransforms.value],
    beside: [...besideTransforms.value],
    solo: solo.value,
    soloLight: soloLight.value,
    paths: seenPaths.value,
  };
  const story = { steps: history.steps.value, cursor: history.cursor.value };
  try {
    keep(keptKey(id), JSON.stringify(kept));
    keep(HISTORY + id, toText(story, MAX_HISTORY_LENGTH, lookThumbnail));
  } catch {
    // storage is full or forbidden: a reload then starts from the scene's own look
  }
}

/** Keep URL and storage in step with the editor. */
export function followPlace(): void {
  effect(() => {
    if (page.value !== "editor" || scene.value === null) return;
    const url = placeToUrl({
      scene: scene.value.id,
      bake: bake.value,
      view: viewName.value,
      beside: sideBySide.value ? shownViews.value : [],
      material: selectedMaterial.value,
      term: selectedTerm.value,
      curve: selectedCurve.value,
      light: selectedLight.value,
      room: door.value?.room ?? null,
      watch: watching.value ? (door.value?.watch ?? null) : null,
      share: null,
    });
    window.history.replaceState(null, "", url);
  });
  window.addEventListener("pagehide", remember);
  document.addEventListener("visibilitychange", remember);
}
