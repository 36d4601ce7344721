/** One view's picture: takes the frames of a session, keeps them, and says what lies where. The screen it is on draws
 * it; a picture that is on no screen keeps what it has. */
import { decodeRgb9e5 } from "../color/rgb9e5";
import type { Frame } from "../net/binaryFrame";
import type { Fidelity, Rgb } from "../protocol";
import { brushed } from "../state/curveShape";
import { materialNames } from "../state/scene";
import type { Arrival } from "./arrival";
import { applyFrame, brushImage, copyPixels, emptyPixels, normalised, takeAlpha, type Pixels } from "./pixels";
import type { Ids } from "./png16";
import type { Renderer } from "./renderer";
import type { Canvas } from "./transform";

const BACKGROUND = 65535;

/** What a picture may be shown on. */
export interface Shows {
  readonly renderer: Renderer;
  present(): Promise<void>;
  redraw(): void;
  size(): Canvas;
}

export class Picture {
  pixels = emptyPixels(1, 1);
  /** The A side of a comparison. */
  reference: Pixels | null = null;
  /** The same as `alpha`, of the A side. */
  referenceAlpha: Uint8Array | null = null;
  ids: Ids | null = null;
  /** The bake that the ids are of, or will be when they have come. */
  idsOf: string | null = null;
  /** Share of each pixel that a stretch of the curve lights, 255 = the most of all. */
  brush: Uint8Array | null = null;
  /** How much each pixel hides of what is put behind it, which its light has been multiplied by; null: all. */
  alpha: Uint8Array | null = null;
  /** What the server has tone-mapped already, where that is what was sent last. */
  display: ImageBitmap | null = null;
  revision = 0;
  /** The revision for which it is exact; −1 while it is not. */
  exactRevision = -1;
  /** The same of what a room's look has become. */
  exactShared = -1;
  fidelity: Fidelity = "preview";
  screen: Shows | null = null;

  constructor(readonly view: string) {}

  /** Take a frame and draw it; a picture of another size replaces what was there. Resolves when it is drawn. */
  async show(frame: Frame): Promise<void> {
    const { width, height, kind, format, revision } = frame.header;
    if (kind === "brush") return this.showBrush(frame);
    if (format === "jpeg") return this.showJpeg(frame);
    if (this.pixels.width !== width || this.pixels.height !== height) {
      this.pixels = emptyPixels(width, height);
      this.brush = this.alpha = null;
      this.screen?.renderer.setPicture(this.pixels);
    }
    if (frame.header.tiles.length > 0) {
      this.display = null;
      this.takeTiles(frame);
    }
    this.revision = revision;
    return this.screen?.present();
  }

  /** Show a picture that has arrived in place of the one that is there. Resolves when it is drawn. */
  async showArrived({ pixels, alpha, jpeg, header }: Arrival): Promise<void> {
    this.brush = null;
    this.revision = header.revision;
    if (pixels !== null) {
      this.pixels = pixels;
      this.display = null;
      this.screen?.renderer.setPicture(pixels);
      this.setAlpha(alpha);
    }
    return jpeg === null ? this.screen?.present() : this.showJpeg(jpeg);
  }

  private takeTiles(frame: Frame): void {
    const tiles = applyFrame(this.pixels, frame);
    this.setAlpha(takeAlpha(this.alpha, frame));
    // one big upload is quicker than many small ones of the same size
    const area = tiles.reduce((sum, { words }) => sum + words.length, 0);
    if (area > this.pixels.words.length / 2) this.screen?.renderer.updatePicture(this.pixels);
    else this.screen?.renderer.uploadTiles(tiles);
  }

  private setAlpha(alpha: Uint8Array | null): void {
    this.alpha = alpha;
    if (alpha !== null) this.screen?.renderer.setAlpha(this.pixels.width, this.pixels.height, alpha);
  }

  private showBrush(frame: Frame): void {
    if (brushed.peek() === null) return;
    this.brush = normalised(brushImage(frame));
    this.screen?.renderer.setBrush(frame.header.width, frame.header.height, this.brush);
    this.screen?.redraw();
  }

  private async showJpeg(frame: Frame): Promise<void> {
    const blob = new Blob([frame.payload as BlobPart], { type: "image/jpeg" });
    this.display = await createImageBitmap(blob, { colorSpaceConversion: "none" });
    this.screen?.renderer.setDisplay(this.display);
    this.revision = frame.header.revision;
    return this.screen?.present();
  }

  get aspect(): number {
    return this.pixels.width / this.pixels.height;
  }

  get isThere(): boolean {
    return this.pixels.width > 1 || this.display !== null;
  }

  setIds(ids: Ids | null): void {
    this.ids = ids;
    if (ids !== null) this.screen?.renderer.setIds(ids.width, ids.height, ids.values);
    this.screen?.redraw();
  }

  /** Keep it as it is now as the A side of comparisons. */
  keepAsReference(): void {
    this.reference = copyPixels(this.pixels);
    this.referenceAlpha = this.alpha?.slice() ?? null;
    this.showReference();
    this.screen?.redraw();
  }

  forgetReference(): void {
    this.reference = this.referenceAlpha = null;
    this.screen?.redraw();
  }

  /** Give the A side to the screen. */
  showReference(): void {
    const { reference, referenceAlpha, screen } = this;
    if (reference === null) return;
    screen?.renderer.setReference(reference);
    if (referenceAlpha !== null)
      screen?.renderer.setReferenceAlpha(reference.width, reference.height, referenceAlpha);
  }

  /** Linear radiance of a pixel; null outside. */
  radiance(x: number, y: number): Rgb | null {
    if (x < 0 || y < 0 || x >= this.pixels.width || y >= this.pixels.height) return null;
    return decodeRgb9e5(this.pixels.words[y * this.pixels.width + x] ?? 0);
  }

  /** Name of the material at a pixel; null for the background. */
  material(x: number, y: number): string | null {
    const { ids } = this;
    if (ids === null || x < 0 || y < 0 || x >= ids.width || y >= ids.height) return null;
    const id = ids.values[y * ids.width + x] ?? BACKGROUND;
    return id === BACKGROUND ? null : (materialNames.peek()[id] ?? null);
  }
}
