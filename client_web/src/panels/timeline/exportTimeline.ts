/** The timeline as numbered frames in a ZIP, or as a video. */
import { completeLook } from "../looks/abCompare";
import { currentPose, startExport } from "../looks/exportImage";
import { interpolation, keyframes, currentPath } from "../looks/keyframes";
import type { RenderRequest } from "../../protocol";
import { FPS, numFrames, renderPath } from "./playback";

/** `exact`: as where the camera stops, where it moves. */
export function exportAnimation(format: "png" | "mp4", exact: boolean): Promise<void> {
  const looks = keyframes.value.map(({ look }) => completeLook(look)) as unknown as RenderRequest["looks"];
  const frames = Math.max(numFrames.value, looks.length);
  const camera = currentPose();
  const path = renderPath(currentPath.value, frames) ?? (camera === null ? null : { eyes: [camera] });
  const fetchFrom = format === "mp4" ? "video.mp4" : "archive.zip";
  return startExport("animation", fetchFrom, { format, looks, between: interpolation.value, fps: FPS, exact, path, frames });
}
