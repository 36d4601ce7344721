/** Images made on the client: thumbnails and PNG export. Same tone mapping as the canvas. */
import { decodeRgb9e5 } from "../../render/color/rgb9e5";
import { toDisplay, type DisplayTransform } from "../../render/color/tonemap";
import type { PixelBuffer } from "../../render/pixels";
import type { Look, Rgb } from "../../protocol";
import { transformOf } from "../../state/color";

const THUMBNAIL_WIDTH = 144;
const TAPS = 2;

type Display = Look["display"];

function writePixel(image: ImageData, index: number, radiance: Rgb, transform: DisplayTransform, alpha = 255): void {
  const displayColor = toDisplay(radiance, transform);
  image.data.set([...displayColor.map((v) => Math.round(255 * v)), alpha], 4 * index);
}

/** The whole image as displayed. `alpha`: coverage per pixel, premultiplied into the radiance; null: opaque. */
export function renderDisplay(pixels: PixelBuffer, alpha: Uint8Array | null, display: Display): ImageData {
  const [image, transform] = [new ImageData(pixels.width, pixels.height), transformOf(display)];
  pixels.encoded.forEach((word, i) => {
    const covers = alpha?.[i] ?? 255;
    const foreground = decodeRgb9e5(word).map((v) => (255 * v) / Math.max(1, covers)) as Rgb;
    writePixel(image, i, foreground, transform, covers);
  });
  return image;
}

/** Mean of a few samples of a thumbnail's pixel. */
function boxSample(pixels: PixelBuffer, x: number, y: number, step: number): Rgb {
  const sum: Rgb = [0, 0, 0];
  for (let i = 0; i < TAPS * TAPS; i++) {
    const px = Math.min(pixels.width - 1, Math.floor((x + ((i % TAPS) + 0.5) / TAPS) * step));
    const py = Math.min(pixels.height - 1, Math.floor((y + (Math.floor(i / TAPS) + 0.5) / TAPS) * step));
    decodeRgb9e5(pixels.encoded[py * pixels.width + px] ?? 0).forEach((v, c) => (sum[c] = (sum[c] as number) + v));
  }
  return sum.map((v) => v / TAPS ** 2) as Rgb;
}

function toCanvas(image: ImageData): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [image.width, image.height];
  canvas.getContext("2d")?.putImageData(image, 0, 0);
  return canvas;
}

/** A small JPEG as a data URL. */
export function renderThumbnail(pixels: PixelBuffer, display: Display, width = THUMBNAIL_WIDTH): string {
  const step = pixels.width / width;
  const image = new ImageData(width, Math.max(1, Math.round(pixels.height / step)));
  const transform = transformOf(display);
  for (let y = 0; y < image.height; y++) {
    for (let x = 0; x < image.width; x++)
      writePixel(image, y * image.width + x, boxSample(pixels, x, y, step), transform);
  }
  return toCanvas(image).toDataURL("image/jpeg", 0.85);
}

/** End of a PNG's first chunk, its header. */
const HEADER_END = 33;
/** An "sRGB" chunk with its checksum: sRGB colors, perceptual rendering intent. */
const SRGB_CHUNK = new Uint8Array([0, 0, 0, 1, 0x73, 0x52, 0x47, 0x42, 0, 0xae, 0xce, 0x1c, 0xe9]);

/** True if the displayed image is sRGB: all tone maps except views of other displays. */
const isSrgb = ({ tone_map }: Display): boolean => typeof tone_map === "string" || tone_map.display.includes("sRGB");

/** The PNG tagged as sRGB. */
export function addSrgbChunk(png: Blob): Blob {
  return new Blob([png.slice(0, HEADER_END), SRGB_CHUNK, png.slice(HEADER_END)], { type: png.type });
}

export async function encodePng(pixels: PixelBuffer, alpha: Uint8Array | null, display: Display): Promise<Blob> {
  const canvas = toCanvas(renderDisplay(pixels, alpha, display));
  const png = await new Promise<Blob | null>((resolve) => canvas.toBlob(resolve, "image/png"));
  if (png === null) throw new Error("The browser could not write the picture as PNG. Try again.");
  return isSrgb(display) ? addSrgbChunk(png) : png;
}
