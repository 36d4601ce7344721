/** The time line as numbered frames in a ZIP, or as a video. */
import { completed } from "../looks/compare";
import { eyeNow, render } from "../looks/export";
import { between, keyframes, turns } from "../looks/keyframes";
import type { RenderRequest } from "../protocol";
import { FPS, numFrames } from "./play";

/** `exact`: as where the eye rests, where it moves. */
export function exportAnimation(format: "png" | "mp4", exact: boolean): Promise<void> {
  const looks = keyframes.value.map(({ look }) => completed(look)) as unknown as RenderRequest["looks"];
  const [eye, frames] = [eyeNow(), numFrames.value];
  const around = { path: { turntable: frames, start: eye } };
  const still = { path: eye === null ? null : { eyes: [eye] }, frames };
  const fetchFrom = format === "mp4" ? "video.mp4" : "archive.zip";
  const more = turns.value && eye !== null ? around : still;
  return render("animation", fetchFrom, { format, looks, between: between.value, fps: FPS, exact, ...more });
}
