/** Pending bakes that replace the shown one when they are ready. */
import { connectToBake } from "../connect";
import { setBakeReadyListener } from "../sessionHandlers";
import * as api from "../net/api";
import { waitForBake, subscribeToBake } from "../net/bakeEvents";
import type { BakeBody, SceneBody } from "../../protocol";
import { bake, bakes, pendingBake } from "../../state/bakes";
import { page } from "../../state/scene";
import { reportErrors, showError } from "../../ui/toasts";
import { quality, type BakeSettings } from "./bakeSettings";
import { previewSize } from "./recipe";

let stopUpdates: () => void = () => undefined;
/** The bake that a session was opened on last. */
let openedBake: string | null = null;

/** Show a bake, once its first image is there. */
export function openBake(id: string): void {
  openedBake = id;
  connectToBake(id);
}

/** Open a session on a finer bake once; it takes over when its first image is there. */
function swapToBake(id: string): void {
  if (page.peek() === "editor" && id !== bake.peek() && id !== openedBake) openBake(id);
}

/** Follow a bake that is meant to replace the one shown. */
export function trackBake(startedBake: BakeBody): void {
  stopUpdates();
  pendingBake.value = startedBake;
  stopUpdates = subscribeToBake(startedBake.id, (update) => {
    pendingBake.value = update;
    if (update.state === "ready") swapToBake(update.id);
    if (update.state === "failed")
      showError(`The bake failed: ${api.problemText(update.problem)} The picture stays as it is.`);
  });
}

export function stopTrackingBake(): void {
  stopUpdates();
}

// a bake of this scene that comes to be ready takes over only where it is finer, of the same light; one that was ready when
// the scene was opened does not: the address, or the user, named the one that is shown
setBakeReadyListener((id) => {
  const current = bake.peek();
  if (current === null || id === current) return;
  if (bakes.peek().some((each) => each.id === id && each.state === "ready")) return;
  void reportErrors(async () => {
    const [readyBake, shownBake] = await Promise.all([api.getBake(id), api.getBake(current)]);
    if (readyBake.recipe.method === shownBake.recipe.method && quality(readyBake) > quality(shownBake)) swapToBake(id);
  });
});

/** Bake what is soon there to be shown, and wait for it; gives its id. */
export async function bakePreview(scene: SceneBody, choice: BakeSettings): Promise<string> {
  const { size, lights: _, patches: __, gather_rays: ___, ...settings } = choice;
  const sizeOverride = size === undefined ? {} : { size: previewSize(size) };
  const preview = await api.startBake({ scene: scene.id, ...settings, ...sizeOverride, preset: "preview" });
  pendingBake.value = preview;
  const finished = preview.state === "ready" ? preview : await waitForBake(preview.id, (update) => (pendingBake.value = update));
  if (finished.state === "ready") return finished.id;
  throw new api.ApiError(`The preview could not be baked: ${api.problemText(finished.problem, finished.state)}`, 0);
}

/** Bake a scene and take the result over when it is ready. */
export async function startFullBake(scene: SceneBody, choice: BakeSettings): Promise<void> {
  const fullBake = await api.startBake({ scene: scene.id, ...choice });
  if (fullBake.state === "ready") swapToBake(fullBake.id);
  else trackBake(fullBake);
}
