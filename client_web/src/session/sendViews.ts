/** Which views a server is asked to show, and from where. */
import type { HelloMessage } from "../protocol";
import { placedCameraOf } from "../state/cameras";
import { availableViews, shownViews, activeViewName } from "../state/views";
import { connections, type BakeConnection } from "./connections";
import { resetExactness } from "./fidelityState";

/** Of a bake's views, those that the user wants to see. */
export function shownViewsOf({ views, focused_view }: HelloMessage): string[] {
  const names = views.map(({ name }) => name);
  return availableViews(shownViews.peek(), names, names.includes(focused_view) ? focused_view : (names[0] ?? focused_view));
}

/** The view that will have the focus when a bake is shown. */
export function activeViewOf(hello: HelloMessage): string | null {
  const [shownNames, active] = [shownViewsOf(hello), activeViewName.peek()];
  return shownNames.includes(active) ? active : (shownNames[0] ?? null);
}

/** Say which views are shown, where that is news, and which of them goes first. */
export function sendViews(bakeConnection: BakeConnection, shownNames: string[], focus: string): void {
  const names = JSON.stringify(shownNames);
  if (bakeConnection.sentViews !== names) {
    if (!bakeConnection.session.send({ type: "views", names: shownNames })) return;
    bakeConnection.sentViews = names;
    bakeConnection.pendingFrames.retain(shownNames);
    if (bakeConnection === connections.shown) resetExactness(shownNames); // they are sent whole again
  }
  if (shownNames.length > 1 && shownNames.includes(focus)) bakeConnection.session.send({ type: "focus", view: focus });
}

/** Send the placed cameras of free-camera views: a pending bake is rendered from there at once. */
export function sendCameras(bakeConnection: BakeConnection, hello: HelloMessage): void {
  const shownNames = shownViewsOf(hello);
  for (const { name, camera_mode: cameraMode } of hello.views) {
    const placedCamera = cameraMode === "free" && shownNames.includes(name) ? placedCameraOf(name) : null;
    if (placedCamera === null) continue;
    const { camera, size } = placedCamera;
    bakeConnection.session.send({ type: "camera", view: name, seq: Date.now(), ...camera, size, active_control: null, refine: "exact" });
  }
}
