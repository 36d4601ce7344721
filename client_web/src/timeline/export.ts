/** The time line as numbered frames in a ZIP, or as a video. */
import { completed } from "../looks/compare";
import { eyeNow, render } from "../looks/export";
import { between, keyframes, wayNow } from "../looks/keyframes";
import type { RenderRequest } from "../protocol";
import { FPS, numFrames, pathOf } from "./play";

/** `exact`: as where the eye rests, where it moves. */
export function exportAnimation(format: "png" | "mp4", exact: boolean): Promise<void> {
  const looks = keyframes.value.map(({ look }) => completed(look)) as unknown as RenderRequest["looks"];
  const frames = Math.max(numFrames.value, looks.length);
  const eye = eyeNow();
  const path = pathOf(wayNow.value, frames) ?? (eye === null ? null : { eyes: [eye] });
  const fetchFrom = format === "mp4" ? "video.mp4" : "archive.zip";
  return render("animation", fetchFrom, { format, looks, between: between.value, fps: FPS, exact, path, frames });
}
