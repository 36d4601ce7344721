/** The client's copy of an image: RGB9_E5 pixels, so that pixel probe, export, thumbnails and a lost GPU context need no
 * round trip. */
import { encodeRgb9e5 } from "./color/rgb9e5";
import type { Frame } from "../session/net/binaryFrame";
import type { Tile } from "../protocol";

export interface PixelBuffer {
  readonly width: number;
  readonly height: number;
  /** Row-major, top row first. */
  readonly encoded: Uint32Array;
}

export function emptyPixels(width: number, height: number): PixelBuffer {
  return { width, height, encoded: new Uint32Array(width * height) };
}

export function copyPixels(pixels: PixelBuffer): PixelBuffer {
  return { ...pixels, encoded: pixels.encoded.slice() };
}

function copyTile(target: PixelBuffer, tile: Tile, encoded: Uint32Array): void {
  const [x, y, w, h] = tile;
  for (let row = 0; row < h; row++) {
    target.encoded.set(encoded.subarray(row * w, (row + 1) * w), (y + row) * target.width + x);
  }
}

/** The payload as RGB9_E5 values, copied only if the header's length left it unaligned. */
function readRgb9e5(bytes: Uint8Array): Uint32Array {
  const aligned = bytes.byteOffset % 4 === 0 ? bytes : bytes.slice();
  return new Uint32Array(aligned.buffer, aligned.byteOffset, aligned.byteLength / 4);
}

function encodeFloats(bytes: Uint8Array): Uint32Array {
  const floats = new Float32Array(bytes.slice().buffer);
  const encoded = new Uint32Array(floats.length / 3);
  for (let i = 0; i < encoded.length; i++) {
    encoded[i] = encodeRgb9e5(floats[3 * i] ?? 0, floats[3 * i + 1] ?? 0, floats[3 * i + 2] ?? 0);
  }
  return encoded;
}

/** The image of a frame whose one tile covers it, without a copy of its pixels; null for other frames. */
export function wholeImage({ header, payload }: Frame): PixelBuffer | null {
  const { width, height, tiles, format } = header;
  const isWhole = tiles.length === 1 && tiles[0]?.[2] === width && tiles[0][3] === height;
  return isWhole && format === "rgb9e5" ? { width, height, encoded: readRgb9e5(payload) } : null;
}

/** Write a frame's tiles into the image and return each tile's encoded pixels, ready for upload. */
export function applyFrame(target: PixelBuffer, frame: Frame): { tile: Tile; encoded: Uint32Array }[] {
  const encoded = frame.header.format === "f32" ? encodeFloats(frame.payload) : readRgb9e5(frame.payload);
  let offset = 0;
  return frame.header.tiles.map((tile) => {
    const count = tile[2] * tile[3];
    const tilePixels = encoded.subarray(offset, offset + count);
    offset += count;
    copyTile(target, tile, tilePixels);
    return { tile, encoded: tilePixels };
  });
}

/** Minimum scale of the brush: weaker contributions do not reach the full tint. */
const MIN_WEIGHT = 5;

/** Scale an image so that its largest value is 255. */
export function normalizeWeights(values: Uint8Array): Uint8Array {
  const largest = values.reduce((a, b) => Math.max(a, b), MIN_WEIGHT);
  return values.map((value) => (value * 255) / largest);
}

/** Write the bytes of consecutive tiles into an image. */
export function copyTiles(target: Uint8Array, width: number, tiles: readonly Tile[], bytes: Uint8Array): void {
  let offset = 0;
  for (const [x, y, w, h] of tiles) {
    for (let row = 0; row < h; row++) {
      target.set(bytes.subarray(offset, offset + w), (y + row) * width + x);
      offset += w;
    }
  }
}

/** Coverage of the whole image after a frame; null if opaque everywhere. `previous` may be overwritten. */
export function readAlpha(previous: Uint8Array | null, { header, alpha }: Frame): Uint8Array | null {
  if (alpha === null) return header.tiles.length > 0 ? null : previous;
  const size = header.width * header.height;
  const all = previous?.length === size ? previous : new Uint8Array(size).fill(255);
  copyTiles(all, header.width, header.tiles, alpha);
  return all;
}

/** A brush frame, the fraction of each pixel's light from an interval of the curve, as one image; 255 is the maximum. */
export function brushImage(frame: Frame): Uint8Array {
  const { width, height, tiles } = frame.header;
  const values = new Uint8Array(width * height);
  copyTiles(values, width, tiles, frame.payload);
  return values;
}
