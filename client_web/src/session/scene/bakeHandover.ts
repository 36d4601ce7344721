/** Pending bakes, which replace the shown one when ready. */
import { connectToBake } from "../connect";
import { setBakeReadyListener } from "../sessionHandlers";
import * as api from "../net/api";
import { waitForBake, subscribeToBake } from "../net/bakeEvents";
import type { BakeBody, SceneBody } from "../../protocol";
import { bake, bakes, pendingBake, renderedBake } from "../../state/bakes";
import { page } from "../../state/scene";
import { reportErrors, showError } from "../../ui/toasts";
import { quality, type BakeSettings } from "./bakeSettings";
import { previewSize } from "./recipe";

let stopUpdates: () => void = () => undefined;
/** The bake that a session was opened on last. */
let openedBake: string | null = null;

/** Show a bake once its first image is available. */
export function openBake(id: string): void {
  openedBake = id;
  connectToBake(id);
}

/** Open a session on a new bake once; it replaces the shown one when its first image is available. */
function swapToBake(id: string): void {
  if (page.peek() === "editor" && id !== bake.peek() && id !== openedBake) openBake(id);
}

/** Track a bake that will replace the shown one. */
export function trackBake(startedBake: BakeBody): void {
  stopUpdates();
  pendingBake.value = startedBake;
  stopUpdates = subscribeToBake(startedBake.id, (update) => {
    pendingBake.value = update;
    if (update.state === "ready") swapToBake(update.id);
    if (update.state === "failed")
      showError(`Bake failed: ${api.problemText(update.problem)} Your picture and edits are unchanged.`);
  });
}

export function stopTrackingBake(): void {
  stopUpdates();
}

// a bake of this scene that becomes ready replaces the shown one only if it is finer and has the same method; a bake that was
// ready when the scene was opened does not: the URL or the user chose the shown one
setBakeReadyListener((id) => {
  const current = bake.peek();
  if (current === null || id === current || id === renderedBake.peek()) return;
  if (bakes.peek().some((each) => each.id === id && each.state === "ready")) return;
  void reportErrors(async () => {
    const [readyBake, shownBake] = await Promise.all([api.getBake(id), api.getBake(current)]);
    if (readyBake.recipe.method === shownBake.recipe.method && quality(readyBake) > quality(shownBake)) swapToBake(id);
  });
});

/** Bake a preview and wait for it; returns its id. */
export async function bakePreview(scene: SceneBody, choice: BakeSettings): Promise<string> {
  const { size, lights: _, patches: __, gather_rays: ___, ...settings } = choice;
  const sizeOverride = size === undefined ? {} : { size: previewSize(size) };
  const preview = await api.startBake({ scene: scene.id, ...settings, ...sizeOverride, preset: "preview" });
  pendingBake.value = preview;
  const finished =
    preview.state === "ready" ? preview : await waitForBake(preview.id, (update) => (pendingBake.value = update));
  if (finished.state === "ready") return finished.id;
  throw new api.ApiError(`Preview failed: ${api.problemText(finished.problem, finished.state)}`, 0);
}

/** Bake a scene and show the result when ready. */
export async function startFullBake(scene: SceneBody, choice: BakeSettings): Promise<void> {
  const fullBake = await api.startBake({ scene: scene.id, ...choice });
  if (fullBake.state === "ready") swapToBake(fullBake.id);
  else trackBake(fullBake);
}
