/** A and B: A is a picture that was kept, B is the live one. */
import { effect, signal } from "@preact/signals";
import { seeFrom, seenNow, type Seen } from "../cameras/eye";
import { isSame } from "../document/difference";
import { replaceLook } from "../edit/edit";
import { history } from "../edit/history";
import { completedLight } from "../lights/kinds";
import { withPicturesOf } from "../live/want";
import { stage } from "../picture/stage";
import type { Look } from "../protocol";
import { isPartOfLook } from "../seen/limits";
import { connection } from "../state/connection";
import { held, showBefore, wipe } from "../state/display";
import { exact } from "../state/fidelity";
import { defaultLook, look } from "../state/look";
import { filmstripOpen } from "../state/panels";
import { scene } from "../state/scene";
import { lookThumbnail } from "../state/thumbnails";
import { attempt, note } from "../ui/toasts";
import { thumbnail } from "./image";
import { addLook, unusedName } from "./shelf";

/** The look whose picture is kept as A, what it is called, and from where it was seen. */
export const sideA = signal<{ look: Look; label: string; seen: Seen } | null>(null);

/** The look that was saved last, while its name waits to be typed over. */
export const justSaved = signal<string | null>(null);

/** Missing parts of a saved look are the scene's own. */
export function completed(partial: Partial<Look>): Look {
  const base = defaultLook.value as Look;
  return {
    materials: { ...base.materials, ...partial.materials },
    environment: { ...base.environment, ...partial.environment },
    background: { ...base.background, ...partial.background },
    lights: {
      ...base.lights,
      ...Object.fromEntries(
        Object.entries(partial.lights ?? {}).map(([name, light]) => [name, completedLight(light, base.lights[name])]),
      ),
    },
    transport: { ...base.transport, ...partial.transport },
    display: { ...base.display, ...partial.display },
  };
}

export function markA(): void {
  if (look.value === null || !stage.active.isThere) return;
  sideA.value = { look: look.value, label: "kept", seen: seenNow() };
  stage.keepReference();
  note("This picture is A now. W wipes between A and B, the live picture; C shows A while it is held.");
}

/** Keep the picture of another look as A; it is fetched from the server. */
export async function markLook(of: Look, label: string): Promise<void> {
  await attempt(async () => {
    await withPicturesOf(of, () => stage.keepReference());
    sideA.value = { look: of, label, seen: seenNow() };
  });
}

/** The live picture becomes A, and A becomes live, seen from where it was. It is a way to compare, so it takes no undone
 * steps away. */
export function swapA(): void {
  const [a, live] = [sideA.value, look.value];
  if (a === null || live === null) return;
  const seen = seenNow();
  stage.keepReference();
  if (!isSame(live, a.look) && history.keepUndone())
    note("What you had undone is kept in the history, before the swap.");
  replaceLook("Swap A and B", a.look);
  seeFrom(a.seen);
  sideA.value = { look: live, label: "swapped", seen };
}

export function toggleWipe(): void {
  wipe.value = { ...wipe.value, on: !wipe.value.on };
}

export async function saveLook(): Promise<void> {
  const current = look.value;
  if (current === null) return;
  const image = isPartOfLook() ? lookThumbnail(current) : thumbnail(stage.active.pixels, current.display);
  const name = await attempt(unusedName);
  if (name === undefined) return;
  filmstripOpen.value = true;
  justSaved.value = name;
  await addLook(name, current, image); // without one it gets its own when it is shown whole
}

// until somebody keeps another picture, A is the one the scene opened with
let openedScene: string | null = null;
effect(() => {
  const id = scene.value?.id ?? null;
  if (!exact.value || id === null || id === openedScene) return;
  openedScene = id;
  sideA.value = { look: look.peek() as Look, label: "as opened", seen: seenNow() };
  stage.keepReference();
});

// a view that was not shown when A was kept has no picture of it yet
effect(() => {
  const a = sideA.value;
  const isCompared = wipe.value.on || showBefore.value;
  if (a === null || !isCompared || !exact.value || held.value || connection.value !== "open") return;
  if (stage.shown.some((picture) => picture.reference === null)) void markLook(a.look, a.label);
});
