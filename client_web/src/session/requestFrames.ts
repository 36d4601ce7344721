/** Requests images of the look from the server: on every edit, and when light filters change. */
import { effect } from "@preact/signals";
import type { LookChange } from "../state/document/jsonPatch";
import { onLookChange } from "../edit/edit";
import { activeControl } from "../edit/activeControl";
import { stage } from "../render/renderStage";
import type { Look } from "../protocol";
import { pathOverride, withVisiblePaths } from "../state/visibility/lightPaths";
import { soloLight, soloSources } from "../state/visibility/soloSources";
import { connection } from "../state/connection";
import { isDisplayFrozen } from "../state/display";
import { dropShownEdits } from "../state/latency";
import { look } from "../state/look";
import { focusedView } from "../state/views";
import { clearErrors } from "../ui/toasts";
import { connections, type BakeConnection } from "./connections";
import { untilExact } from "./fidelityState";

/** Request frames of a look with the visible light; `change` is the edit that made it. Without one, no control is
 * active. */
export function requestFrames(bakeConnection: BakeConnection | null, targetLook: Look, inputTime: number, change: LookChange | null = null): void {
  const visibleLook = withVisiblePaths(targetLook);
  const target = { look: visibleLook, activeControl: change && activeControl.peek(), solo: soloSources(targetLook), inputTime };
  bakeConnection?.session.setTarget(target, visibleLook === targetLook ? change : null);
}

/** In a room, the incoming bake gets edits from there. */
function requestFramesEverywhere(targetLook: Look, inputTime: number, change: LookChange | null = null): void {
  requestFrames(connections.shown, targetLook, inputTime, change);
  if (connections.incoming?.hello?.room == null) requestFrames(connections.incoming, targetLook, inputTime, change);
}

onLookChange((change, inputTime) => {
  clearErrors("edit"); // this edit supersedes a rejected one
  requestFramesEverywhere(change.after, inputTime, change);
});

effect(() => {
  void soloLight.value;
  void pathOverride.value;
  const current = look.peek();
  if (current !== null) requestFramesEverywhere(current, performance.now());
});

// revisions already drawn while another view was measured have no latency
effect(() => dropShownEdits(stage.imageOf(focusedView.value).revision));

/** Capture the exact images of another look while the canvases are frozen. */
export async function withViews(targetLook: Look, capture: () => void): Promise<void> {
  if (connection.peek() !== "open") throw new Error("Not connected. Try again when the connection is back.");
  const previousLook = look.peek() as Look;
  isDisplayFrozen.value = true;
  try {
    requestFrames(connections.shown, targetLook, performance.now());
    await new Promise((done) => requestAnimationFrame(done));
    await untilExact();
    capture();
  } finally {
    requestFrames(connections.shown, look.peek() ?? previousLook, performance.now());
    await new Promise((done) => requestAnimationFrame(done));
    await untilExact();
    isDisplayFrozen.value = false;
  }
}
