/** Opening a scene: the finest bake there is, or a preview at once and the full bake behind it. */
import * as api from "../net/api";
import { bakeEnd, followBake } from "../net/events";
import { stage } from "../picture/stage";
import { MAX_VIEWS_SHOWN, type BakeBody, type SceneBody } from "../protocol";
import type { Method } from "../start/methods";
import { previewSize, type Size } from "../start/recipe";
import { attempt, showError } from "../ui/toasts";
import { connect, disconnect, whenBakeIsReady } from "./live";
import { recall, recallHistory, remember } from "./place";
import * as store from "./store";
import { placeFromUrl, type Place } from "./url";
import { availableOf } from "./views";

export type Preset = "preview" | "good" | "final";
export interface BakeChoice {
  method: Method;
  views: string[];
  /** Gives the size and the number of lights that are not named beside it. */
  preset?: Preset;
  size?: Size;
  lights?: number;
  /** Divided for light that will be turned or exchanged. */
  relightable?: boolean;
}

/** The views that are baked where nobody chooses: as many as can be seen at once. */
export function viewsToBake(scene: SceneBody): string[] {
  return scene.views.slice(0, MAX_VIEWS_SHOWN).map((view) => view.name);
}

let stopFollowing: () => void = () => undefined;

function pixels(bake: BakeBody): number {
  return bake.recipe.size[0] * bake.recipe.size[1] * bake.recipe.lights;
}

/** A scene's bakes, finest first. */
export async function bakesOf(scene: SceneBody): Promise<BakeBody[]> {
  const bakes = await api.bakesOfScene(scene.id);
  return bakes.sort((a, b) => pixels(b) - pixels(a));
}

function reset(scene: SceneBody): void {
  remember();
  disconnect();
  stopFollowing();
  stage.clear();
  store.history.clear();
  store.scene.value = scene;
  store.look.value = store.defaultLook.value = null;
  store.bake.value = store.coming.value = store.method.value = null;
  store.selectedMaterial.value = store.selectedCurve.value = null;
  store.selectedLight.value = store.solo.value = store.soloLight.value = store.seenPaths.value = null;
  store.alonePlaces.value = store.besidePlaces.value = new Map();
  store.pointedView.value = null;
  store.connection.value = "connecting";
  store.freezing.value = null;
  store.fidelity.value = "exact";
  store.page.value = "editor";
}

function restorePlace(scene: SceneBody, place: Place): void {
  const kept = recall(scene.id);
  if (kept !== null) {
    store.look.value = kept.look;
    recallHistory(scene.id, kept.look);
    store.solo.value = kept.solo ?? null;
    store.soloLight.value = kept.soloLight ?? null;
    store.seenPaths.value = kept.paths ?? null;
    store.alonePlaces.value = new Map(kept.alone);
    store.besidePlaces.value = new Map(kept.beside);
  }
  const names = scene.views.map((view) => view.name);
  const active = place.view ?? names[0] ?? "";
  const shown = availableOf(place.beside.length > 1 ? place.beside : [active], names, active);
  store.shownViews.value = shown;
  store.viewName.value = shown.includes(active) ? active : (shown[0] as string);
  if (scene.materials.some((material) => material.name === place.material)) {
    store.selectedMaterial.value = place.material;
    store.selectedTerm.value = place.term;
    store.selectedCurve.value = place.curve;
  } else store.selectedLight.value = place.light;
}

/** Call back when there is a look of the scene: one that was kept at once, the scene's own with the first hello. */
function onceThereIsALook(scene: SceneBody, take: () => void): void {
  let waits = true;
  const stop = store.look.subscribe((look) => {
    if (!waits || (look === null && store.scene.peek() === scene)) return;
    waits = false;
    queueMicrotask(() => stop());
    if (store.scene.peek() === scene) take();
  });
}

/** Follow a bake that is meant to replace the one shown. */
export function follow(bake: BakeBody): void {
  stopFollowing();
  store.coming.value = bake;
  stopFollowing = followBake(bake.id, (news) => {
    store.coming.value = news;
    if (news.state === "ready") swapTo(news.id);
    if (news.state === "failed")
      showError(`The bake failed: ${api.problemText(news.problem)} The picture stays as it is.`);
  });
}

/** The bake that a session was opened on last. */
let opened: string | null = null;

/** Open a session on a finer bake once; it takes over when its first picture is there. */
function swapTo(bake: string): void {
  if (store.page.peek() !== "editor" || bake === store.bake.peek() || bake === opened) return;
  opened = bake;
  connect(bake);
}

// somebody else's bake of this scene takes over only where it is finer, of the same light
whenBakeIsReady((id) => {
  const current = store.bake.peek();
  if (current === null || id === current) return;
  void attempt(async () => {
    const [other, shown] = await Promise.all([api.getBake(id), api.getBake(current)]);
    if (other.recipe.method === shown.recipe.method && pixels(other) > pixels(shown)) swapTo(id);
  });
});

async function bakePreview(scene: SceneBody, choice: BakeChoice): Promise<string> {
  const { size, lights: _, ...rest } = choice;
  const shape = size === undefined ? {} : { size: previewSize(size) };
  const preview = await api.startBake({ scene: scene.id, ...rest, ...shape, preset: "preview" });
  store.coming.value = preview;
  const end = preview.state === "ready" ? preview : await bakeEnd(preview.id, (news) => (store.coming.value = news));
  if (end.state === "ready") return end.id;
  throw new api.ApiError(`The preview could not be baked: ${api.problemText(end.problem, end.state)}`, 0);
}

/** Bake a scene and take the result over when it is ready. */
export async function startFullBake(scene: SceneBody, choice: BakeChoice): Promise<void> {
  const full = await api.startBake({ scene: scene.id, ...choice });
  if (full.state === "ready") swapTo(full.id);
  else follow(full);
}

export async function openScene(
  id: string,
  place: Place = placeFromUrl(`?scene=${id}`),
  choice?: BakeChoice,
  /** Called once, when there is a look to be changed. */
  arrived?: () => void,
): Promise<void> {
  await attempt(async () => {
    const [scene, models] = await Promise.all([api.getScene(id), api.listModels()]);
    store.models.value = models;
    reset(scene);
    restorePlace(scene, place);
    if (arrived !== undefined) onceThereIsALook(scene, arrived);
    const bakes = await bakesOf(scene);
    store.bakes.value = bakes;
    const ready = bakes.filter((bake) => bake.state === "ready");
    const shown = ready.find((bake) => bake.id === place.bake) ?? ready[0];
    const running = bakes.find((bake) => bake.state === "running" || bake.state === "queued");
    const wanted = choice ?? { method: "direct", preset: "good", views: viewsToBake(scene) };
    opened = shown?.id ?? (await bakePreview(scene, wanted));
    connect(opened);
    if (choice === undefined && running !== undefined) follow(running);
    else if (choice !== undefined || shown === undefined) await startFullBake(scene, wanted);
  });
}

export function leave(): void {
  remember();
  disconnect();
  stopFollowing();
  store.page.value = "start";
  window.history.pushState(null, "", "/");
}
