/** Pixel → curve: requests a pixel's contributions, one request at a time, the newest pixel first. */
import { effect } from "@preact/signals";
import { sendToShown } from "../session/connections";
import { isMoving } from "../session/clientRendering";
import type { ViewImage } from "../render/viewImage";
import { displayedFrames } from "../state/display";
import { pixelProbe } from "../state/pointerPixel";

const EVERY_MS = 40;
const GIVE_UP_MS = 1000;
let timer = 0;
let lastRequest = 0;

function waitTime(): boolean {
  return pixelProbe.peek()?.answer === null && performance.now() - lastRequest < GIVE_UP_MS;
}

function sendProbe(): void {
  timer = 0;
  const position = pixelProbe.peek();
  if (position === null || isMoving(position.view)) return; // the server still has the previous camera: probe when the camera has stopped
  lastRequest = performance.now();
  sendToShown({ type: "inspect", view: position.view, x: position.x, y: position.y });
}

function scheduleProbe(): void {
  if (timer === 0) timer = window.setTimeout(sendProbe, waitTime() ? EVERY_MS * 3 : EVERY_MS);
}

/** Probe the pixel under the pointer; nothing outside the image. */
export function probeAt(image: ViewImage, x: number, y: number): void {
  if (image.radiance(x, y) === null) return clearProbe();
  const { view } = image;
  const last = pixelProbe.peek();
  if (last?.view === view && last.x === x && last.y === y) return;
  // keep the last response until the next one, so that the plot does not flicker
  pixelProbe.value = { view, x, y, answer: last?.answer ?? null };
  scheduleProbe();
}

export function clearProbe(): void {
  clearTimeout(timer);
  timer = 0;
  if (pixelProbe.peek() !== null) pixelProbe.value = null;
}

// the contributions change with the image
effect(() => {
  void displayedFrames.value;
  if (pixelProbe.peek() !== null && performance.now() - lastRequest > 4 * EVERY_MS) scheduleProbe();
});
