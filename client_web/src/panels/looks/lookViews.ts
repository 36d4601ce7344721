/** Views saved with looks: choosing the look restores both. */
import { cameraOf, moveFreeCamera } from "../../viewport/cameras/freeCamera";
import type { LookView } from "../../protocol";
import { activeViewName, setFocus, shownViews, showSingleView, views } from "../../state/views";

/** The active view with the pose of its free camera; null without a view. */
export function currentView(): LookView | null {
  const view = activeViewName.peek();
  if (view === "") return null;
  const camera = cameraOf(view);
  return { view, camera: camera === null ? null : { ...camera, near: camera.near ?? 0 } };
}

/** Show a saved view, if the bake has it. */
export function restoreView({ view, camera }: LookView): void {
  if (!views.peek().some(({ name }) => name === view)) return;
  if (shownViews.peek().includes(view)) setFocus(view);
  else showSingleView(view);
  if (camera !== null) moveFreeCamera(view, camera);
}
