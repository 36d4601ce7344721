/** Paints waveforms: columns as in the image, display values from 0 at the bottom to 100 % at the top. */
import type { Waveform } from "../render/waveform";
import type { Rgb } from "../protocol";

/** Distance of the scale's lines, percent. */
const LINE_STEP = 25;
const LUMA_COLOR: Rgb = [215, 215, 215];
/** Readable on black. */
const CHANNEL_COLORS: readonly Rgb[] = [
  [255, 92, 92],
  [84, 220, 110],
  [104, 150, 255],
];

/** One trace as an image; rare values stay visible. */
function traceImage({ columns, levels, rows }: Waveform, counts: Uint32Array, color: Rgb): ImageData {
  const image = new ImageData(columns, levels);
  counts.forEach((n, at) => {
    if (n === 0) return;
    const [column, level] = [Math.floor(at / levels), at % levels];
    const alpha = Math.min(255, 70 + 420 * Math.sqrt(n / rows));
    image.data.set([...color, alpha], 4 * ((levels - 1 - level) * columns + column));
  });
  return image;
}

function drawTrace(ctx: CanvasRenderingContext2D, image: ImageData, left: number, width: number, height: number): void {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [image.width, image.height];
  canvas.getContext("2d")?.putImageData(image, 0, 0);
  ctx.imageSmoothingEnabled = false;
  ctx.drawImage(canvas, left, 0, width, height);
}

/** Paint luma, or red, green and blue beside each other. */
export function paintWaveform(
  canvas: HTMLCanvasElement,
  waveform: Waveform,
  isParade: boolean,
  size: [number, number],
) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = size;
  [canvas.width, canvas.height] = [width * ratio, height * ratio];
  const ctx = canvas.getContext("2d");
  if (ctx === null) return;
  ctx.scale(ratio, ratio);
  const style = getComputedStyle(canvas);
  ctx.font = `10px ${style.fontFamily}`;
  const traces = isParade
    ? waveform.channels.map((counts, c) => traceImage(waveform, counts, CHANNEL_COLORS[c] as Rgb))
    : [traceImage(waveform, waveform.luma, LUMA_COLOR)];
  traces.forEach((image, k) => drawTrace(ctx, image, (k * width) / traces.length, width / traces.length, height));
  for (let percent = 0; percent <= 100; percent += LINE_STEP) {
    const y = Math.round((height - 1) * (1 - percent / 100));
    ctx.fillStyle = "#ffffff38";
    ctx.fillRect(0, y, width, 1);
    ctx.fillStyle = style.color;
    if (percent > 0 && percent < 100) ctx.fillText(String(percent), 2, y - 2);
  }
}
