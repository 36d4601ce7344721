/** Stores the user's state for a reload: scene, bake, views and selection in the URL; look, zoom and history in the tab's
 * storage. */
import { effect } from "@preact/signals";
import { previewedStep } from "../../edit/edit";
import { history } from "../../edit/history";
import { parseHistory, serializeHistory } from "../../edit/journal";
import type { ZoomTransform } from "../../render/zoomTransform";
import { singleTransforms, gridTransforms } from "../../render/viewTransforms";
import type { Look, Transport } from "../../protocol";
import { pathOverride } from "../../state/visibility/lightPaths";
import { soloMaterial, soloLight } from "../../state/visibility/soloSources";
import { bake } from "../../state/bakes";
import { look } from "../../state/look";
import { page, scene } from "../../state/scene";
import { selectedCurve, selectedLight, selectedMaterial, selectedTerm } from "../../state/selection";
import { joinState, isWatching } from "../../state/collaboration";
import { storeThumbnail, lookThumbnail } from "../../state/thumbnails";
import { shownViews, sideBySide, activeViewName } from "../../state/views";
import { formatUrl } from "./url";

interface SavedState {
  look: Look;
  /** Zoom transforms of each view, alone and in the grid. */
  single: [view: string, transform: ZoomTransform][];
  grid: [view: string, transform: ZoomTransform][];
  /** The solo material and light, and the light-path filter. */
  solo?: string | null;
  soloLight?: string | null;
  paths?: Transport | null;
}

const sceneKey = (scene: string) => `relume.scene.${scene}`;
const HISTORY_KEY_PREFIX = "relume.history.";
/** Maximum length of a scene's history; browsers limit a tab's storage to a few million characters. */
const MAX_HISTORY_LENGTH = 1 << 20;

export function loadSceneState(scene: string): SavedState | null {
  try {
    return JSON.parse(sessionStorage.getItem(sceneKey(scene)) ?? "null") as SavedState | null;
  } catch {
    return null;
  }
}

/** Restore the stored history of a scene's look, if any. */
export function loadHistory(scene: string, look: Look): void {
  try {
    const text = sessionStorage.getItem(HISTORY_KEY_PREFIX + scene);
    const snapshot = text === null ? null : parseHistory(text, joinState.peek() === null ? look : null, storeThumbnail);
    if (snapshot !== null) history.restore(snapshot.steps, snapshot.cursor);
  } catch {
    // from an older editor, or storage is forbidden: start a new history
  }
}

/** Store a text; if storage is full, drop histories of other scenes. */
function storeText(key: string, text: string): void {
  try {
    sessionStorage.setItem(key, text);
  } catch {
    for (const otherKey of Object.keys(sessionStorage))
      if (otherKey.startsWith(HISTORY_KEY_PREFIX)) sessionStorage.removeItem(otherKey);
    sessionStorage.setItem(key, text);
  }
}

export function saveSceneState(): void {
  const [id, current] = [scene.value?.id, previewedStep.value?.before ?? look.value];
  if (page.value !== "editor" || id === undefined || current === null) return;
  const saved: SavedState = {
    look: current,
    single: [...singleTransforms.value],
    grid: [...gridTransforms.value],
    solo: soloMaterial.value,
    soloLight: soloLight.value,
    paths: pathOverride.value,
  };
  const snapshot = { steps: history.steps.value, cursor: history.cursor.value };
  try {
    storeText(sceneKey(id), JSON.stringify(saved));
    storeText(HISTORY_KEY_PREFIX + id, serializeHistory(snapshot, MAX_HISTORY_LENGTH, lookThumbnail));
  } catch {
    // storage is full or forbidden: a reload starts from the scene's own look
  }
}

/** Keep URL and storage in sync with the editor. */
export function trackUrl(): void {
  effect(() => {
    if (page.value !== "editor" || scene.value === null) return;
    const url = formatUrl({
      scene: scene.value.id,
      bake: bake.value,
      view: activeViewName.value,
      sideBySide: sideBySide.value ? shownViews.value : [],
      material: selectedMaterial.value,
      term: selectedTerm.value,
      curve: selectedCurve.value,
      light: selectedLight.value,
      room: joinState.value?.room ?? null,
      watch: isWatching.value ? (joinState.value?.watch ?? null) : null,
      share: null,
    });
    window.history.replaceState(null, "", url);
  });
  window.addEventListener("pagehide", saveSceneState);
  document.addEventListener("visibilitychange", saveSceneState);
}
