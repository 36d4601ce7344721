/** Sends the visible region of each image: the server refines it first. */
import { effect } from "@preact/signals";
import { stage } from "../render/renderStage";
import { visibleRegion } from "../render/zoomTransform";
import { transformOf } from "../render/viewTransforms";
import { displayedFrames } from "../state/display";
import { connections, type BakeConnection } from "./connections";
import { shownViewsOf } from "./sendViews";

/** A zoom or pan is sent when it settles. */
const SETTLE_MS = 150;

/** Send changed regions of the views with a fixed camera. */
export function sendRegions(bakeConnection: BakeConnection | null): void {
  if (!bakeConnection?.hello) return;
  const connection = shownViewsOf(bakeConnection.hello);
  for (const { name, camera_mode: cameraMode, width, height } of bakeConnection.hello.views) {
    const screen = stage.imageOf(name).screen;
    if (cameraMode === "free" || screen === null || !connection.includes(name)) continue;
    const canvas = { ...screen.size(), aspect: width / height };
    const rect = visibleRegion(transformOf(name), canvas, width, height);
    const text = JSON.stringify(rect);
    if (text === (bakeConnection.sentRegions.get(name) ?? "null")) continue;
    if (bakeConnection.session.send({ type: "region", view: name, rect })) bakeConnection.sentRegions.set(name, text);
  }
}

effect(() => {
  void displayedFrames.value;
  const timer = setTimeout(() => {
    sendRegions(connections.shown);
    sendRegions(connections.incoming);
  }, SETTLE_MS);
  return () => clearTimeout(timer);
});
