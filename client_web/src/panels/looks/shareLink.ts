/** Links that carry the look: saved on the server, never changed, opened as a step that can be undone. */
import { effect, signal } from "@preact/signals";
import { moveFreeCamera, currentCameras } from "../../viewport/cameras/freeCamera";
import { replaceLook } from "../../edit/edit";
import { history } from "../../edit/history";
import { getShare, createShare } from "../../session/net/api";
import type { ShareBody, ShareEntry } from "../../protocol";
import { openScene } from "../../session/scene/openScene";
import type { UrlState } from "../../session/scene/url";
import { pathOverride } from "../../state/visibility/lightPaths";
import { soloMaterial, soloLight } from "../../state/visibility/soloSources";
import { bake, bakes } from "../../state/bakes";
import { look } from "../../state/look";
import { mayEdit, joinTarget } from "../../state/sessionUser";
import { shownViews, activeViewName, views } from "../../state/views";
import { reportErrors, showNote } from "../../ui/toasts";

/** A link that the browser did not let us copy: it is shown to be copied by hand. */
export const linkToCopy = signal<string | null>(null);

/** Save the visible state. */
export async function createShareLink(): Promise<ShareEntry> {
  const [id, current] = [bake.value, look.value];
  if (id === null || current === null) throw new Error("There is no picture to share yet.");
  const { poses, sizes } = currentCameras();
  return createShare({
    bake: id,
    view: activeViewName.value,
    views: shownViews.value,
    look: { ...current },
    solo: soloMaterial.value,
    solo_light: soloLight.value,
    paths: pathOverride.value,
    cameras: poses,
    sizes,
  });
}

/** Save the visible state and copy the link to it. */
export async function copyShareLink(): Promise<void> {
  await reportErrors(async () => {
    const link = new URL((await createShareLink()).url, location.href).href;
    try {
      await navigator.clipboard.writeText(link);
      showNote("The link is copied. It shows this picture as it is now, whatever you change later.");
    } catch {
      linkToCopy.value = link;
    }
  });
}

function urlStateOf(shared: ShareBody, room: string | null, watch: string | null): UrlState {
  const sideBySide = shared.views.length > 1 ? shared.views : [];
  const nothing = { material: null, term: 0, curve: null, light: null };
  return { scene: shared.scene, bake: shared.bake, view: shared.view, sideBySide, ...nothing, room, watch, share: shared.id };
}

/** Apply a shared state: the look is a step, which undo takes back to the user's own. */
function applySharedState(shared: ShareBody): void {
  replaceLook("Shared look", shared.look);
  history.endGesture();
  soloMaterial.value = shared.solo;
  soloLight.value = shared.solo_light;
  pathOverride.value = shared.paths;
}

/** See the views from where they were shared, once they are there: the look is, before. */
function applySharedCameras({ cameras: poses, sizes }: ShareBody): void {
  let waits = true;
  const stop = effect(() => {
    if (!waits || bake.value === null || !views.value.some(({ name }) => name in poses)) return;
    waits = false;
    queueMicrotask(() => {
      stop();
      for (const [name, camera] of Object.entries(poses)) moveFreeCamera(name, camera, sizes[name] ?? null);
    });
  });
}

/** Open what a link carries. In a room that it names it is what the room begins with. */
export async function openShare(id: string, { room, watch }: Pick<UrlState, "room" | "watch">): Promise<void> {
  await reportErrors(async () => {
    const shared = await getShare(id);
    if (shared.missing.length > 0) throw new Error(shared.missing.join(" "));
    const hasNoRoom = room === null && watch === null;
    joinTarget.value = mayEdit.value ? null : { scene: shared.scene, share: id };
    const isFromServer = () => {
      if (hasNoRoom && mayEdit.value) applySharedState(shared);
      applySharedCameras(shared);
    };
    await openScene(shared.scene, urlStateOf(shared, room, watch), undefined, isFromServer);
    if (bakes.value.every((bake) => bake.id !== shared.bake || bake.state !== "ready"))
      showNote("The bake of this link is gone. Its look is shown in another bake of the scene.");
  });
}
