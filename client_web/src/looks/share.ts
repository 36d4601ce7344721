/** Links that carry the look: saved on the server, never changed, opened as a step that can be undone. */
import { effect, signal } from "@preact/signals";
import { lookFrom, seenNow } from "../cameras/eye";
import { replaceLook } from "../edit/edit";
import { history } from "../edit/history";
import { getShare, makeShare } from "../net/api";
import type { ShareBody, ShareEntry } from "../protocol";
import { openScene } from "../scene/open";
import type { Place } from "../scene/url";
import { seenPaths } from "../seen/paths";
import { solo, soloLight } from "../seen/solo";
import { bake, bakes } from "../state/bakes";
import { look } from "../state/look";
import { mayEdit, watched } from "../state/me";
import { shownViews, viewName, views } from "../state/views";
import { attempt, note } from "../ui/toasts";

/** A link that the browser did not let us copy: it is shown to be copied by hand. */
export const linkToCopy = signal<string | null>(null);

/** Save what is seen now. */
export async function saveShare(): Promise<ShareEntry> {
  const [id, current] = [bake.value, look.value];
  if (id === null || current === null) throw new Error("There is no picture to share yet.");
  return makeShare({
    bake: id,
    view: viewName.value,
    views: shownViews.value,
    look: { ...current },
    solo: solo.value,
    solo_light: soloLight.value,
    paths: seenPaths.value,
    ...seenNow(),
  });
}

/** Save what is seen now, and copy the link to it. */
export async function share(): Promise<void> {
  await attempt(async () => {
    const link = new URL((await saveShare()).url, location.href).href;
    try {
      await navigator.clipboard.writeText(link);
      note("The link is copied. It shows this picture as it is now, whatever you change later.");
    } catch {
      linkToCopy.value = link;
    }
  });
}

function placeOf(shared: ShareBody, room: string | null, watch: string | null): Place {
  const beside = shared.views.length > 1 ? shared.views : [];
  const nothing = { material: null, term: 0, curve: null, light: null };
  return { scene: shared.scene, bake: shared.bake, view: shared.view, beside, ...nothing, room, watch, share: shared.id };
}

/** Take over what was seen: the look is a step, which undo takes back to the visitor's own. */
function takeOver(shared: ShareBody): void {
  replaceLook("Shared look", shared.look);
  history.seal();
  solo.value = shared.solo;
  soloLight.value = shared.solo_light;
  seenPaths.value = shared.paths;
}

/** See the views from where they were shared, once they are there: the look is, before. */
function lookFromThere({ eyes, sizes }: ShareBody): void {
  let waits = true;
  const stop = effect(() => {
    if (!waits || bake.value === null || !views.value.some(({ name }) => name in eyes)) return;
    waits = false;
    queueMicrotask(() => {
      stop();
      for (const [name, camera] of Object.entries(eyes)) lookFrom(name, camera, sizes[name] ?? null);
    });
  });
}

/** Open what a link carries. In a room that it names it is what the room begins with. */
export async function openShare(id: string, { room, watch }: Pick<Place, "room" | "watch">): Promise<void> {
  await attempt(async () => {
    const shared = await getShare(id);
    if (shared.lacking.length > 0) throw new Error(shared.lacking.join(" "));
    const isAlone = room === null && watch === null;
    watched.value = mayEdit.value ? null : { scene: shared.scene, share: id };
    const arrived = () => {
      if (isAlone && mayEdit.value) takeOver(shared);
      lookFromThere(shared);
    };
    await openScene(shared.scene, placeOf(shared, room, watch), undefined, arrived);
    if (bakes.value.every((bake) => bake.id !== shared.bake || bake.state !== "ready"))
      note("The bake of this link is gone. Its look is shown in another bake of the scene.");
  });
}
