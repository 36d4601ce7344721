/** Shows saved looks, with their views. */
import { replaceLook } from "../../edit/edit";
import { connectToBake } from "../../session/connect";
import { bake } from "../../state/bakes";
import { scene } from "../../state/scene";
import { joinTarget, mayEdit } from "../../state/sessionUser";
import { showNote } from "../../ui/toasts";
import { completeLook } from "./abCompare";
import { restoreView } from "./lookViews";
import { savedLooks, type SavedLook } from "./savedLooks";

/** Apply a saved look and its view; for a read-only user, a new session starts with it. */
export function showSaved({ name, look, view }: SavedLook): void {
  const [openScene, current] = [scene.value, bake.value];
  if (view !== null) restoreView(view);
  if (mayEdit.value || openScene === null || current === null) return replaceLook(`Show ${name}`, completeLook(look));
  joinTarget.value = { scene: openScene.id, look: name };
  connectToBake(current);
}

/** Show the saved look of a number key, counted from 1. */
export function showSavedAt(number: number): void {
  const saved = savedLooks.peek()[number - 1];
  if (saved === undefined) showNote(`There is no saved look ${number}.`);
  else showSaved(saved);
}
