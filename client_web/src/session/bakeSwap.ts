/** Routes frames to images: a view's first image is held back until it is complete; a new bake replaces the shown one
 * when the active view is complete. */
import { batch } from "@preact/signals";
import { request } from "./net/api";
import type { Frame } from "./net/binaryFrame";
import type { PendingFrame } from "../render/frameArrival";
import { decodeIds } from "../render/png16";
import { stage } from "../render/renderStage";
import { axes, bake, pendingBake, method } from "../state/bakes";
import { connection, freezeStatus } from "../state/connection";
import { bakedFreeCameraError, freeCameraError } from "../state/fidelity";
import { clearPendingEdits } from "../state/latency";
import { shownViews, activeViewName, views } from "../state/views";
import { reportErrors, showNote, showError } from "../ui/toasts";
import { connections, type BakeConnection } from "./connections";
import { recordShownFrame, resetExactness } from "./fidelityState";
import { activeViewOf, shownViewsOf } from "./sendViews";
import { assumeRoom } from "./roomSync";

async function loadMaterialIds(bakeId: string, view: string, pendingFrame: PendingFrame): Promise<void> {
  await reportErrors(async () => {
    const path = `/api/bakes/${encodeURIComponent(bakeId)}/views/${encodeURIComponent(view)}/materials.png`;
    pendingFrame.ids = decodeIds(await (await request(path)).arrayBuffer());
    const image = stage.imageOf(view);
    if (image.idsOf === bakeId) image.setIds(pendingFrame.ids);
  });
}

export async function showFrame(source: BakeConnection, frame: Frame): Promise<void> {
  const { view, kind } = frame.header;
  const isShown = source === connections.shown;
  if (source !== connections.incoming && !(isShown && shownViews.peek().includes(view))) return;
  if (!source.pendingFrames.isDisplayed(view))
    return kind === "highlight" ? undefined : receiveFirstFrames(source, frame);
  await stage.imageOf(view).show(frame).catch(showError);
  if (kind === "picture" && source === connections.shown) recordShownFrame(source, frame.header);
}

/** Add a frame of a view whose first image is pending: the displayed image stays until it is complete. */
async function receiveFirstFrames(source: BakeConnection, frame: Frame): Promise<void> {
  const { view } = frame.header;
  const isNew = source.pendingFrames.get(view) === undefined;
  const pendingFrame = source.pendingFrames.addFrame(frame);
  const isFixed = source.hello?.views.find(({ name }) => name === view)?.camera_mode !== "free"; // material ids only fit a fixed camera
  if (isNew && isFixed && stage.imageOf(view).idsOf !== source.bake)
    void loadMaterialIds(source.bake, view, pendingFrame);
  if (!pendingFrame.isComplete) return;
  if (source === connections.shown) return showCompleteView(source, view);
  await swapWhenComplete();
}

async function showCompleteView(bakeConnection: BakeConnection, view: string): Promise<void> {
  const [pendingFrame, image] = [bakeConnection.pendingFrames.get(view), stage.imageOf(view)];
  if (pendingFrame === undefined) return;
  bakeConnection.pendingFrames.markDisplayed(view);
  if (image.idsOf !== bakeConnection.bake) {
    image.idsOf = bakeConnection.bake;
    image.setIds(pendingFrame.ids);
  }
  if (pendingBake.peek()?.id === bakeConnection.bake) pendingBake.value = null;
  await image.showFrame(pendingFrame).catch(showError);
  if (bakeConnection === connections.shown) recordShownFrame(bakeConnection, pendingFrame.header);
}

/** Switch to a connection: its bake and views. */
export function applyBake(bakeConnection: BakeConnection): void {
  if (bakeConnection.hello === null) return;
  const { views: baked, method: light, axes: changeable, free_camera_error: error } = bakeConnection.hello;
  const shownBake = shownViewsOf(bakeConnection.hello);
  batch(() => {
    views.value = baked;
    shownViews.value = shownBake;
    if (bake.peek() !== bakeConnection.bake) freeCameraError.value = null; // belongs to the previous bake
    bakedFreeCameraError.value = error;
    if (!shownBake.includes(activeViewName.peek())) activeViewName.value = shownBake[0] as string;
    bake.value = bakeConnection.bake;
    method.value = light;
    axes.value = changeable;
  });
}

/** The new bake replaces the shown one once the active view is complete; the other views follow. */
export async function swapWhenComplete(): Promise<void> {
  const { incoming } = connections;
  const active = incoming?.hello ? activeViewOf(incoming.hello) : null;
  if (incoming === null || active === null) return;
  if (incoming.pendingFrames.get(active)?.isComplete) await swapConnection(incoming);
}

async function swapConnection(to: BakeConnection): Promise<void> {
  const previous = connections.shown;
  connections.shown = to;
  connections.incoming = null;
  assumeRoom(previous, to);
  previous?.session.close();
  freezeStatus.value = null;
  clearPendingEdits();
  applyBake(to);
  connection.value = "open";
  const shownConnection = shownViews.peek();
  resetExactness(shownConnection);
  const complete = shownConnection.filter((view) => to.pendingFrames.get(view)?.isComplete);
  await Promise.all(complete.map((view) => showCompleteView(to, view)));
  if (to.bake !== previous?.bake) showNote("New bake loaded.");
}
