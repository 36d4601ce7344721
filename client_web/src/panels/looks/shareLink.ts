/** Share links: the look is stored on the server, immutable, and opened as an undoable step. */
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
import { serverUrl } from "../../session/net/serverUrl";

/** A link that the browser did not let us copy, shown for copying by hand. */
export const linkToCopy = signal<string | null>(null);

/** Store the visible state on the server. */
export async function createShareLink(): Promise<ShareEntry> {
  const [id, current] = [bake.value, look.value];
  if (id === null || current === null) throw new Error("Nothing to share yet. Wait for the first picture.");
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

/** Store the visible state and copy its link. */
export async function copyShareLink(): Promise<void> {
  await reportErrors(async () => {
    const link = new URL(serverUrl((await createShareLink()).url), location.href).href;
    try {
      await navigator.clipboard.writeText(link);
      showNote("Link copied. It always shows this version.");
    } catch {
      linkToCopy.value = link;
    }
  });
}

function urlStateOf(shared: ShareBody, room: string | null, watch: string | null): UrlState {
  const sideBySide = shared.views.length > 1 ? shared.views : [];
  const nothing = { material: null, term: 0, curve: null, light: null };
  return {
    scene: shared.scene,
    bake: shared.bake,
    view: shared.view,
    sideBySide,
    ...nothing,
    room,
    watch,
    share: shared.id,
  };
}

/** Apply a shared state: the look is a step, which undo reverts. */
function applySharedState(shared: ShareBody): void {
  replaceLook("Shared look", shared.look);
  history.endGesture();
  soloMaterial.value = shared.solo;
  soloLight.value = shared.solo_light;
  pathOverride.value = shared.paths;
}

/** Apply the shared cameras once the views exist, which is after the look. */
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

/** Open a link's shared state. If the link names a room, it is the room's initial state. */
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
      showNote("This link's bake was deleted. Its look is shown in another bake of the scene.");
  });
}
