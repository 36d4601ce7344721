/** Opens a scene: its finest bake, or a preview while the full bake runs. */
import { previewedStep } from "../../edit/edit";
import { history } from "../../edit/history";
import { disconnectAll } from "../connections";
import { loadColor } from "../colorTransforms";
import { getScene, listModels } from "../net/api";
import { stage } from "../../render/renderStage";
import { singleTransforms, gridTransforms } from "../../render/viewTransforms";
import type { SceneBody } from "../../protocol";
import { pathOverride } from "../../state/visibility/lightPaths";
import { soloMaterial, soloLight } from "../../state/visibility/soloSources";
import { axes, bake, bakes, pendingBake, method } from "../../state/bakes";
import { connection, freezeStatus } from "../../state/connection";
import { fidelity, isOutdated } from "../../state/fidelity";
import { defaultLook, look } from "../../state/look";
import { models, page, scene, unbakedAspect } from "../../state/scene";
import { alsoSelected, selectedCurve, selectedLight, selectedMaterial, selectedTerm } from "../../state/selection";
import { joinState, members, selfNumber, type JoinState } from "../../state/collaboration";
import { availableViews, hoveredView, shownViews, activeViewName } from "../../state/views";
import { reportErrors } from "../../ui/toasts";
import { listBakesByQuality, viewsToBake, type BakeSettings } from "./bakeSettings";
import { DEFAULT_BAKE_METHOD } from "./bakeMethods";
import { loadSceneState, loadHistory, saveSceneState } from "./persistence";
import { bakePreview, trackBake, openBake, startFullBake, stopTrackingBake } from "./bakeHandover";
import { parseUrl, type UrlState } from "./url";

/** Replace the open scene. */
function resetEditor(newScene: SceneBody): void {
  saveSceneState();
  disconnectAll();
  stopTrackingBake();
  stage.clear();
  history.clear();
  previewedStep.value = null;
  scene.value = newScene;
  unbakedAspect.value = null;
  look.value = defaultLook.value = null;
  bake.value = pendingBake.value = method.value = null;
  axes.value = [];
  selectedMaterial.value = selectedCurve.value = null;
  alsoSelected.value = [];
  selectedLight.value = soloMaterial.value = soloLight.value = pathOverride.value = null;
  singleTransforms.value = gridTransforms.value = new Map();
  hoveredView.value = null;
  connection.value = "connecting";
  freezeStatus.value = null;
  fidelity.value = "exact";
  isOutdated.value = false;
  members.value = [];
  selfNumber.value = null;
  page.value = "editor";
}

/** The room in a URL. */
function joinStateOf(scene: string, { room, watch, share }: UrlState): JoinState | null {
  return room === null && watch === null ? null : { scene, room, watch: room === null ? watch : null, share };
}

/** Restore a scene's state stored in this tab. */
function restoreSavedState(id: string): void {
  const saved = loadSceneState(id);
  if (saved === null) return;
  look.value = saved.look;
  loadHistory(id, saved.look);
  soloMaterial.value = saved.solo ?? null;
  soloLight.value = saved.soloLight ?? null;
  pathOverride.value = saved.paths ?? null;
  singleTransforms.value = new Map(saved.single);
  gridTransforms.value = new Map(saved.grid);
}

/** Apply the views and selection of a URL, as far as they exist in the scene. */
function restoreUrlState({ views, materials }: SceneBody, urlState: UrlState): void {
  const names = views.map((view) => view.name);
  const active = urlState.view ?? names[0] ?? "";
  const visibleViews = availableViews(urlState.sideBySide.length > 1 ? urlState.sideBySide : [active], names, active);
  shownViews.value = visibleViews;
  activeViewName.value = visibleViews.includes(active) ? active : (visibleViews[0] as string);
  if (materials.some((material) => material.name === urlState.material)) {
    selectedMaterial.value = urlState.material;
    selectedTerm.value = urlState.term;
    selectedCurve.value = urlState.curve;
  } else selectedLight.value = urlState.light;
}

/** Call back when the scene has a look: a stored one immediately, the scene's own with the first hello. */
function whenLookAvailable(expectedScene: SceneBody, callback: () => void): void {
  let waits = true;
  const stop = look.subscribe((current) => {
    if (!waits || (current === null && scene.peek() === expectedScene)) return;
    waits = false;
    queueMicrotask(() => stop());
    if (scene.peek() === expectedScene) callback();
  });
}

export async function openScene(
  id: string,
  urlState: UrlState = parseUrl(`?scene=${id}`),
  choice?: BakeSettings,
  /** Called once, when there is a look to change. */
  onLook?: () => void,
): Promise<void> {
  await reportErrors(async () => {
    const [opened, sceneModels] = await Promise.all([getScene(id), listModels(), loadColor()]);
    models.value = sceneModels;
    resetEditor(opened);
    joinState.value = joinStateOf(opened.id, urlState);
    restoreSavedState(opened.id);
    restoreUrlState(opened, urlState);
    if (onLook !== undefined) whenLookAvailable(opened, onLook);
    bakes.value = await listBakesByQuality(opened);
    await openBestBake(opened, urlState.bake, choice);
  });
}

/** Aspect ratio of a bake's images. */
function aspectOf({ views }: SceneBody, { size, aspect, views: [first] }: BakeSettings): number | null {
  if (size !== undefined) return size[0] / size[1];
  return aspect ?? views.find(({ name }) => name === first)?.aspect ?? null;
}

/** Show the bake of this id, else the finest; start one if there is none or settings were chosen. */
async function openBestBake(
  openedScene: SceneBody,
  id: string | null,
  choice: BakeSettings | undefined,
): Promise<void> {
  const ready = bakes.peek().filter((each) => each.state === "ready");
  const bestBake = ready.find((each) => each.id === id) ?? ready[0];
  const running = bakes.peek().find((each) => each.state === "running" || each.state === "queued");
  const settings = choice ?? { method: DEFAULT_BAKE_METHOD, preset: "good", views: viewsToBake(openedScene) };
  if (bestBake === undefined) unbakedAspect.value = aspectOf(openedScene, settings);
  openBake(bestBake?.id ?? (await bakePreview(openedScene, settings)));
  if (choice === undefined && running !== undefined) trackBake(running);
  else if (choice !== undefined || bestBake === undefined) await startFullBake(openedScene, settings);
}

export function closeScene(): void {
  saveSceneState();
  disconnectAll();
  stopTrackingBake();
  joinState.value = null;
  page.value = "start";
  window.history.pushState(null, "", "/");
}
