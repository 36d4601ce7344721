/** Links that carry the look: saved on the server, never changed, opened as a step that can be undone. */
import { signal } from "@preact/signals";
import { getShare, makeShare } from "../net/api";
import type { ShareBody } from "../protocol";
import { commit } from "../state/edit";
import { openScene } from "../state/open";
import * as store from "../state/store";
import type { Place } from "../state/url";
import { attempt, note } from "../ui/toasts";

/** A link that the browser did not let us copy: it is shown to be copied by hand. */
export const linkToCopy = signal<string | null>(null);

/** Save what is seen now, and copy the link to it. */
export async function share(): Promise<void> {
  const [bake, look] = [store.bake.value, store.look.value];
  if (bake === null || look === null) return;
  await attempt(async () => {
    const made = await makeShare({
      bake,
      view: store.viewName.value,
      views: store.shownViews.value,
      look: { ...look },
      solo: store.solo.value,
      solo_light: store.soloLight.value,
      paths: store.seenPaths.value,
    });
    const link = new URL(made.url, location.href).href;
    try {
      await navigator.clipboard.writeText(link);
      note("The link is copied. It shows this picture as it is now, whatever you change later.");
    } catch {
      linkToCopy.value = link;
    }
  });
}

function placeOf(shared: ShareBody): Place {
  const beside = shared.views.length > 1 ? shared.views : [];
  return { scene: shared.scene, bake: shared.bake, view: shared.view, beside, material: null, term: 0, curve: null, light: null };
}

/** Take over what was seen: the look is a step, which undo takes back to the visitor's own. */
function takeOver({ look, solo, solo_light, paths }: ShareBody): void {
  if (JSON.stringify(store.look.peek()) !== JSON.stringify(look)) commit("Shared look", look);
  store.history.seal();
  store.solo.value = solo;
  store.soloLight.value = solo_light;
  store.seenPaths.value = paths;
}

/** Open what a link carries. */
export async function openShare(id: string): Promise<void> {
  await attempt(async () => {
    const shared = await getShare(id);
    if (shared.lacking.length > 0) throw new Error(shared.lacking.join(" "));
    await openScene(shared.scene, placeOf(shared), undefined, () => takeOver(shared));
    if (store.bakes.value.every((bake) => bake.id !== shared.bake || bake.state !== "ready"))
      note("The bake of this link is gone. Its look is shown in another bake of the scene.");
  });
}
