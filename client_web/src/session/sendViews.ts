/** Sends the shown views and their cameras to the server. */
import type { HelloMessage } from "../protocol";
import { placedCameraOf } from "../state/cameras";
import { availableViews, shownViews, activeViewName } from "../state/views";
import { connections, type BakeConnection } from "./connections";
import { resetExactness } from "./fidelityState";

/** The views of a bake that the user wants to see. */
export function shownViewsOf({ views, focused_view }: HelloMessage): string[] {
  const names = views.map(({ name }) => name);
  return availableViews(
    shownViews.peek(),
    names,
    names.includes(focused_view) ? focused_view : (names[0] ?? focused_view),
  );
}

/** The view that becomes active when a bake is shown. */
export function activeViewOf(hello: HelloMessage): string | null {
  const [shownNames, active] = [shownViewsOf(hello), activeViewName.peek()];
  return shownNames.includes(active) ? active : (shownNames[0] ?? null);
}

/** Send the shown views, if changed, and the one with priority. */
export function sendViews(bakeConnection: BakeConnection, shownNames: string[], focus: string): void {
  const names = JSON.stringify(shownNames);
  if (bakeConnection.sentViews !== names) {
    if (!bakeConnection.session.send({ type: "views", names: shownNames })) return;
    bakeConnection.sentViews = names;
    bakeConnection.pendingFrames.retain(shownNames);
    if (bakeConnection === connections.shown) resetExactness(shownNames); // the server sends full images again
  }
  if (shownNames.length > 1 && shownNames.includes(focus)) bakeConnection.session.send({ type: "focus", view: focus });
}

/** Send the placed cameras of free-camera views: a pending bake is rendered from there immediately. */
export function sendCameras(bakeConnection: BakeConnection, hello: HelloMessage): void {
  const shownNames = shownViewsOf(hello);
  for (const { name, camera_mode: cameraMode } of hello.views) {
    const placedCamera = cameraMode === "free" && shownNames.includes(name) ? placedCameraOf(name) : null;
    if (placedCamera === null) continue;
    const { camera, size } = placedCamera;
    bakeConnection.session.send({
      type: "camera",
      view: name,
      seq: Date.now(),
      ...camera,
      size,
      active_control: null,
      refine: "exact",
    });
  }
}
