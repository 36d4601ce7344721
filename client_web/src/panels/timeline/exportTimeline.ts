/** Exports the timeline as numbered frames in a ZIP, or as a video. */
import { completeLook } from "../looks/abCompare";
import { currentPose, startExport, type RenderQuality } from "../looks/exportImage";
import { durations, interpolation, keyframes, currentPath } from "../looks/keyframes";
import type { RenderRequest } from "../../protocol";
import { FPS, numFrames, renderPath } from "./playback";

/** `quality`: for free cameras. */
export function exportAnimation(format: "png" | "mp4", quality: RenderQuality): Promise<void> {
  const looks = keyframes.value.map(({ look }) => completeLook(look)) as unknown as NonNullable<RenderRequest["looks"]>;
  const frames = Math.max(numFrames.value, looks.length);
  const camera = currentPose();
  const path = renderPath(currentPath.value, frames) ?? (camera === null ? null : { cameras: [camera] });
  const fetchFrom = format === "mp4" ? "video.mp4" : "archive.zip";
  return startExport("animation", fetchFrom, {
    format,
    looks,
    durations: durations.value,
    interpolation: interpolation.value,
    fps: FPS,
    quality,
    path,
    frames,
  });
}
