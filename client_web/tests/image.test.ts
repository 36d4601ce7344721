import { crc32, deflateSync } from "node:zlib";
import { describe, expect, test } from "vitest";
import { displayMatrix } from "../src/render/color/whiteBalance";
import { srgbDecode, srgbEncode, toDisplay, type DisplayedToneMap } from "../src/render/color/tonemap";
import { decodeIds } from "../src/render/png16";
import {
  FIT,
  fitWidth,
  panTransform,
  visibleRegion,
  displayedWidth,
  toImagePoint,
  toScreenPoint,
  zoomAt,
} from "../src/render/zoomTransform";
import type { Rgb } from "../src/protocol";

describe("tone maps", () => {
  // what the server's own tone map gives at +0.5 stops
  const reference: [DisplayedToneMap, Rgb, Rgb][] = [
    ["none", [0.18, 0.18, 0.18], [0.54157, 0.54157, 0.54157]],
    ["none", [1, 0.2, 0.05], [1, 0.56835, 0.29484]],
    ["agx", [0.18, 0.18, 0.18], [0.55915, 0.55923, 0.55924]],
    ["agx", [1, 0.2, 0.05], [0.87084, 0.59913, 0.42455]],
    ["agx", [6, 4, 9], [0.97353, 0.95731, 0.98942]],
    ["filmic", [0.18, 0.18, 0.18], [0.65026, 0.65026, 0.65026]],
    ["filmic", [1, 0.2, 0.05], [0.93942, 0.67815, 0.30488]],
    ["filmic", [6, 4, 9], [1, 0.99594, 1]],
  ];
  test.each(reference)("%s of %o is what the server shows", (name, radiance, expected) => {
    toDisplay(radiance, { matrix: displayMatrix(0.5, 6500, 0), contrast: 1, toneMap: name, lut: null }).forEach(
      (v, c) => expect(v).toBeCloseTo(expected[c] as number, 4),
    );
  });

  test("sRGB there and back", () => {
    for (const v of [0, 0.001, 0.0031308, 0.18, 0.5, 1]) expect(srgbDecode(srgbEncode(v))).toBeCloseTo(v, 6);
  });
});

describe("transform", () => {
  const canvas = { width: 800, height: 600, aspect: 4 / 3, margin: 16 };

  test("fit leaves a margin and keeps the aspect", () => {
    expect(fitWidth(canvas)).toBeLessThan(800);
    expect(fitWidth({ ...canvas, width: 5000 }) / canvas.aspect).toBeLessThan(600);
    expect(toImagePoint(FIT, canvas, 400, 300)).toEqual([0.5, 0.5]);
  });

  test("what is under the pointer stays there while zooming", () => {
    const at = toImagePoint(FIT, canvas, 520, 210);
    const zoomed = zoomAt(FIT, canvas, 2.5, 520, 210);
    const [u, v] = toImagePoint(zoomed, canvas, 520, 210);
    expect([u, v].map((x, i) => x - (at[i] as number)).every((d) => Math.abs(d) < 1e-12)).toBe(true);
    expect(displayedWidth(zoomed, canvas)).toBeCloseTo(2.5 * fitWidth(canvas), 9);
  });

  test("screen and picture are each other's inverse, and panning follows the hand", () => {
    const zoomed = zoomAt(FIT, canvas, 3, 100, 100);
    const [u, v] = toImagePoint(zoomed, canvas, 333, 222);
    const [x, y] = toScreenPoint(panTransform(zoomed, canvas, 10, -5), canvas, u, v);
    expect([x, y].map(Math.round)).toEqual([343, 217]);
  });

  test("the visible region is in pixels, and omitted if everything is visible", () => {
    expect(visibleRegion(FIT, canvas, 1920, 1440)).toBe(null);
    const zoomed = zoomAt(FIT, canvas, 4, 400, 300);
    const [x, y, width, height] = visibleRegion(zoomed, canvas, 1920, 1440) as number[] as [
      number,
      number,
      number,
      number,
    ];
    expect(Math.abs(2 * x + width - 1920)).toBeLessThanOrEqual(1);
    expect(width / 1920).toBeCloseTo(800 / displayedWidth(zoomed, canvas), 2);
    expect(Math.abs(2 * y + height - 1440)).toBeLessThanOrEqual(1);
    const corner = { ...zoomed, center: [0, 1] as [number, number] };
    const [left, top, across, down] = visibleRegion(corner, canvas, 1920, 1440) as [number, number, number, number];
    expect([left, top + down]).toEqual([0, 1440]);
    expect(Math.abs(across - width / 2) + Math.abs(down - height / 2)).toBeLessThan(2);
  });

  test("the picture cannot be lost", () => {
    expect(panTransform(FIT, canvas, 1e6, 1e6).center).toEqual([0, 0]);
    expect(displayedWidth(zoomAt(FIT, canvas, 1e-9, 0, 0), canvas)).toBeGreaterThan(10);
    expect(displayedWidth(zoomAt(FIT, canvas, 1e9, 0, 0), canvas)).toBeLessThan(1e6);
  });
});

describe("decodeIds", () => {
  const WIDTH = 5;
  const values = [
    0, 1, 300, 65535, 7, 8, 9, 256, 65535, 65535, 1, 2, 3, 4, 5, 500, 400, 300, 200, 100, 12, 13, 14, 15, 65534,
  ];

  function chunk(type: string, body: Uint8Array): Uint8Array {
    const bytes = new Uint8Array(12 + body.length);
    new DataView(bytes.buffer).setUint32(0, body.length);
    bytes.set(new TextEncoder().encode(type), 4);
    bytes.set(body, 8);
    new DataView(bytes.buffer).setUint32(8 + body.length, crc32(bytes.subarray(4, 8 + body.length)));
    return bytes;
  }

  const rowOf = (y: number) => values.slice(y * WIDTH, (y + 1) * WIDTH).flatMap((v) => [v >> 8, v & 255]);

  function paeth(a: number, b: number, c: number): number {
    const p = a + b - c;
    return [a, b, c].reduce((best, v) => (Math.abs(p - v) < Math.abs(p - best) ? v : best), a);
  }

  /** Filters as the PNG specification defines them, one kind per row. */
  function filtered(y: number, filter: number): number[] {
    const row = rowOf(y);
    const up = y > 0 ? rowOf(y - 1) : row.map(() => 0);
    return row.map((x, i) => {
      const [a, b, c] = [row[i - 2] ?? 0, up[i] as number, up[i - 2] ?? 0];
      const predicted = [0, a, b, Math.floor((a + b) / 2), paeth(a, b, c)][filter] as number;
      return (x - predicted + 256) % 256;
    });
  }

  function png(depth = 16, cut = 0): ArrayBuffer {
    const header = new Uint8Array(13);
    new DataView(header.buffer).setUint32(0, WIDTH);
    new DataView(header.buffer).setUint32(4, 5);
    header.set([depth, 0, 0, 0, 0], 8);
    const raw = [0, 1, 2, 3, 4].flatMap((filter, y) => [filter, ...filtered(y, filter)]);
    const data = new Uint8Array(deflateSync(Uint8Array.from(raw)));
    const chunks = [
      Uint8Array.from([137, 80, 78, 71, 13, 10, 26, 10]),
      chunk("IHDR", header),
      chunk("IDAT", data.subarray(0, 6)),
      chunk("IDAT", data.subarray(6)),
      chunk("IEND", new Uint8Array()),
    ];
    const bytes = Uint8Array.from(chunks.flatMap((chunk) => [...chunk]));
    return bytes.buffer.slice(0, bytes.length - cut);
  }

  test("all sixteen bits survive, through every filter", () => {
    const ids = decodeIds(png());
    expect([ids.width, ids.height]).toEqual([WIDTH, 5]);
    expect([...ids.values]).toEqual(values);
  });

  test("what is no such image is refused", () => {
    expect(() => decodeIds(new ArrayBuffer(100))).toThrow("not a PNG");
    expect(() => decodeIds(png(8))).toThrow("not 16-bit gray");
    expect(() => decodeIds(png(16, 20))).toThrow();
    const damaged = png();
    new Uint8Array(damaged).set([1], damaged.byteLength - 20);
    expect(() => decodeIds(damaged)).toThrow("CRC");
    const huge = png();
    new DataView(huge).setUint32(16, 1 << 30);
    expect(() => decodeIds(huge)).toThrow("no usable size");
  });
});
