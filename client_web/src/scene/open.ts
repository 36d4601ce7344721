/** Opening a scene: the finest bake there is, or a preview at once and the full bake behind it. */
import { passing } from "../edit/edit";
import { history } from "../edit/history";
import { disconnect } from "../live/connections";
import { loadColor } from "../live/displayViews";
import { getScene, listModels } from "../net/api";
import { stage } from "../picture/stage";
import { aloneTransforms, besideTransforms } from "../picture/viewTransforms";
import type { SceneBody } from "../protocol";
import { seenPaths } from "../seen/paths";
import { solo, soloLight } from "../seen/solo";
import { axes, bake, bakes, coming, method } from "../state/bakes";
import { connection, freezing } from "../state/connection";
import { fidelity, isOutdated } from "../state/fidelity";
import { defaultLook, look } from "../state/look";
import { models, page, scene } from "../state/scene";
import { selectedCurve, selectedLight, selectedMaterial, selectedTerm } from "../state/selection";
import { door, people, you, type Door } from "../state/together";
import { availableOf, pointedView, shownViews, viewName } from "../state/views";
import { attempt } from "../ui/toasts";
import { bakesOf, viewsToBake, type BakeChoice } from "./bakeChoice";
import { DEFAULT_METHOD } from "./methods";
import { recall, recallHistory, remember } from "./persistence";
import { bakePreview, follow, openBake, startFullBake, stopFollowing } from "./takeover";
import { placeFromUrl, type Place } from "./url";

/** Forget the scene that was open; this one is, from now on. */
function reset(to: SceneBody): void {
  remember();
  disconnect();
  stopFollowing();
  stage.clear();
  history.clear();
  passing.value = null;
  scene.value = to;
  look.value = defaultLook.value = null;
  bake.value = coming.value = method.value = null;
  axes.value = [];
  selectedMaterial.value = selectedCurve.value = null;
  selectedLight.value = solo.value = soloLight.value = seenPaths.value = null;
  aloneTransforms.value = besideTransforms.value = new Map();
  pointedView.value = null;
  connection.value = "connecting";
  freezing.value = null;
  fidelity.value = "exact";
  isOutdated.value = false;
  people.value = [];
  you.value = null;
  page.value = "editor";
}

/** The room that an address names. */
function doorOf(scene: string, { room, watch, share }: Place): Door | null {
  return room === null && watch === null ? null : { scene, room, watch: room === null ? watch : null, share };
}

/** Take up what this tab kept of a scene. */
function restoreKept(id: string): void {
  const kept = recall(id);
  if (kept === null) return;
  look.value = kept.look;
  recallHistory(id, kept.look);
  solo.value = kept.solo ?? null;
  soloLight.value = kept.soloLight ?? null;
  seenPaths.value = kept.paths ?? null;
  aloneTransforms.value = new Map(kept.alone);
  besideTransforms.value = new Map(kept.beside);
}

/** Show and select what an address says, as far as the scene has it. */
function restorePlace({ views, materials }: SceneBody, place: Place): void {
  const names = views.map((view) => view.name);
  const active = place.view ?? names[0] ?? "";
  const shown = availableOf(place.beside.length > 1 ? place.beside : [active], names, active);
  shownViews.value = shown;
  viewName.value = shown.includes(active) ? active : (shown[0] as string);
  if (materials.some((material) => material.name === place.material)) {
    selectedMaterial.value = place.material;
    selectedTerm.value = place.term;
    selectedCurve.value = place.curve;
  } else selectedLight.value = place.light;
}

/** Call back when there is a look of the scene: one that was kept at once, the scene's own with the first hello. */
function onceThereIsALook(of: SceneBody, take: () => void): void {
  let waits = true;
  const stop = look.subscribe((current) => {
    if (!waits || (current === null && scene.peek() === of)) return;
    waits = false;
    queueMicrotask(() => stop());
    if (scene.peek() === of) take();
  });
}

export async function openScene(
  id: string,
  place: Place = placeFromUrl(`?scene=${id}`),
  choice?: BakeChoice,
  /** Called once, when there is a look to be changed. */
  arrived?: () => void,
): Promise<void> {
  await attempt(async () => {
    const [opened, known] = await Promise.all([getScene(id), listModels(), loadColor()]);
    models.value = known;
    reset(opened);
    door.value = doorOf(opened.id, place);
    restoreKept(opened.id);
    restorePlace(opened, place);
    if (arrived !== undefined) onceThereIsALook(opened, arrived);
    bakes.value = await bakesOf(opened);
    await openBakes(opened, place.bake, choice);
  });
}

/** Show the bake of this id, or else the finest; where there is none, or a choice was made, one is started. */
async function openBakes(of: SceneBody, id: string | null, choice: BakeChoice | undefined): Promise<void> {
  const ready = bakes.peek().filter((each) => each.state === "ready");
  const shown = ready.find((each) => each.id === id) ?? ready[0];
  const running = bakes.peek().find((each) => each.state === "running" || each.state === "queued");
  const wanted = choice ?? { method: DEFAULT_METHOD, preset: "good", views: viewsToBake(of) };
  openBake(shown?.id ?? (await bakePreview(of, wanted)));
  if (choice === undefined && running !== undefined) follow(running);
  else if (choice !== undefined || shown === undefined) await startFullBake(of, wanted);
}

export function leave(): void {
  remember();
  disconnect();
  stopFollowing();
  door.value = null;
  page.value = "start";
  window.history.pushState(null, "", "/");
}
