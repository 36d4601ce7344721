/** A and B: A is a picture that was kept, B is the live one. */
import { effect, signal } from "@preact/signals";
import { stage } from "../picture/stage";
import type { Look } from "../protocol";
import { commit } from "../state/edit";
import { fetchPicture } from "../state/live";
import { defaultLook, exact, look, scene, viewName, wipe } from "../state/store";
import { attempt, note } from "../ui/toasts";
import { thumbnail } from "./image";
import { freeName } from "./names";
import { addLook, keepThumbnail, shelf } from "./shelf";

/** The look whose picture is kept as A, and what it is called. */
export const sideA = signal<{ look: Look; label: string; view: string } | null>(null);

/** Missing parts of a saved look are the scene's own. */
export function completed(partial: Partial<Look>): Look {
  const base = defaultLook.value as Look;
  return {
    materials: { ...base.materials, ...partial.materials },
    environment: { ...base.environment, ...partial.environment },
    lights: { ...base.lights, ...partial.lights },
    display: { ...base.display, ...partial.display },
  };
}

export function markA(): void {
  if (look.value === null || !stage.hasPicture) return;
  sideA.value = { look: look.value, label: "kept", view: viewName.value };
  stage.setReference(stage.capture());
  note("This picture is A now. W wipes between A and the live picture.");
}

/** Keep the picture of another look as A; it is fetched from the server. */
export async function markLook(of: Look, label: string): Promise<void> {
  await attempt(async () => {
    stage.setReference(await fetchPicture(of));
    sideA.value = { look: of, label, view: viewName.value };
  });
}

/** The live look becomes A, and A becomes live. */
export function swapA(): void {
  const [a, live] = [sideA.value, look.value];
  if (a === null || live === null) return;
  const picture = stage.capture();
  commit("Swap A and live", a.look);
  stage.setReference(picture);
  sideA.value = { look: live, label: "swapped", view: viewName.value };
}

export function toggleWipe(): void {
  const on = !wipe.value.on;
  const a = sideA.value;
  wipe.value = { ...wipe.value, on };
  // the view has changed since A was kept: its picture from here is another one
  if (on && a !== null && a.view !== viewName.value) void markLook(a.look, a.label);
}

export async function saveLook(): Promise<void> {
  const current = look.value;
  if (current === null) return;
  const name = freeName(shelf.value.map((entry) => entry.name));
  keepThumbnail(name, thumbnail(stage.capture(), current.display));
  await addLook(name, current);
}

// until somebody keeps another picture, A is the one the scene opened with
let openedScene: string | null = null;
effect(() => {
  const id = scene.value?.id ?? null;
  if (!exact.value || id === null || id === openedScene) return;
  openedScene = id;
  sideA.value = { look: look.peek() as Look, label: "as opened", view: viewName.peek() };
  stage.setReference(stage.capture());
});
