/** One view's image: receives and stores the frames of a session, and answers lookups. Its canvas draws it; without one
 * it keeps its content. */
import { decodeRgb9e5 } from "./color/rgb9e5";
import type { Frame } from "../session/net/binaryFrame";
import type { Fidelity, Rgb } from "../protocol";
import { brushedRange } from "../state/curvePreview";
import { materialNames } from "../state/scene";
import type { PendingFrame } from "./frameArrival";
import { applyFrame, brushImage, copyPixels, emptyPixels, normalizeWeights, readAlpha, wholeImage, type PixelBuffer } from "./pixels";
import type { MaterialIds } from "./png16";
import type { DisplayRenderer } from "./displayRenderer";
import type { CanvasGeometry } from "./zoomTransform";

const BACKGROUND = 65535;

/** A screen that can show an image. */
export interface ImagePresenter {
  readonly renderer: DisplayRenderer;
  present: () => Promise<void>;
  redraw: () => void;
  size: () => CanvasGeometry;
}

export class ViewImage {
  pixels = emptyPixels(1, 1);
  /** The A side of a comparison. */
  reference: PixelBuffer | null = null;
  /** The same as `alpha`, for the A side. */
  referenceAlpha: Uint8Array | null = null;
  ids: MaterialIds | null = null;
  /** The bake of the ids, also while they are loading. */
  idsOf: string | null = null;
  /** Fraction of each pixel's light from an interval of the curve; 255 is the maximum. */
  brush: Uint8Array | null = null;
  /** Coverage of each pixel, premultiplied into its radiance; null: opaque. */
  alpha: Uint8Array | null = null;
  /** The newest frame, if it was tone-mapped by the server. */
  display: ImageBitmap | null = null;
  revision = 0;
  /** The revision for which the image is exact; −1 while it is not. */
  exactRevision = -1;
  /** The same for the room's version of the look. */
  exactShared = -1;
  fidelity: Fidelity = "preview";
  screen: ImagePresenter | null = null;

  constructor(readonly view: string) {}

  /** Store and draw a frame; a frame of another size replaces the image. Resolves when drawn. */
  async show(frame: Frame): Promise<void> {
    const { width, height, kind, format, revision } = frame.header;
    if (kind === "highlight") return this.showBrush(frame);
    if (format === "jpeg") return this.showJpeg(frame);
    if (this.pixels.width !== width || this.pixels.height !== height) {
      this.pixels = emptyPixels(width, height);
      this.brush = this.alpha = null;
      this.screen?.renderer.setImage(this.pixels);
    }
    if (frame.header.tiles.length > 0) {
      this.display = null;
      this.addTiles(frame);
    }
    this.revision = revision;
    return this.screen?.present();
  }

  /** Show a complete image in place of the current one. Resolves when it is drawn. */
  async showFrame({ pixels, alpha, jpeg, header }: PendingFrame): Promise<void> {
    this.brush = null;
    this.revision = header.revision;
    if (pixels !== null) {
      this.pixels = pixels;
      this.display = null;
      this.screen?.renderer.setImage(pixels);
      this.setAlpha(alpha);
    }
    return jpeg === null ? this.screen?.present() : this.showJpeg(jpeg);
  }

  private addTiles(frame: Frame): void {
    this.setAlpha(readAlpha(this.alpha, frame));
    const whole = wholeImage(frame);
    if (whole !== null) {
      this.pixels = whole;
      this.screen?.renderer.updateImage(whole);
      return;
    }
    const tiles = applyFrame(this.pixels, frame);
    // one large upload is faster than many small ones
    const area = tiles.reduce((sum, { encoded }) => sum + encoded.length, 0);
    if (area > this.pixels.encoded.length / 2) this.screen?.renderer.updateImage(this.pixels);
    else this.screen?.renderer.uploadTiles(tiles);
  }

  private setAlpha(alpha: Uint8Array | null): void {
    this.alpha = alpha;
    if (alpha !== null) this.screen?.renderer.setAlpha(this.pixels.width, this.pixels.height, alpha);
  }

  private showBrush(frame: Frame): void {
    if (brushedRange.peek() === null) return;
    this.brush = normalizeWeights(brushImage(frame));
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

  get hasPixels(): boolean {
    return this.pixels.width > 1 || this.display !== null;
  }

  setIds(ids: MaterialIds | null): void {
    this.ids = ids;
    if (ids !== null) this.screen?.renderer.setIds(ids.width, ids.height, ids.values);
    this.screen?.redraw();
  }

  /** Store the current image as the A side. */
  storeReference(): void {
    this.reference = copyPixels(this.pixels);
    this.referenceAlpha = this.alpha?.slice() ?? null;
    this.showReference();
    this.screen?.redraw();
  }

  clearReference(): void {
    this.reference = this.referenceAlpha = null;
    this.screen?.redraw();
  }

  /** Upload the A side to the screen. */
  showReference(): void {
    const { reference, referenceAlpha, screen } = this;
    if (reference === null) return;
    screen?.renderer.setReference(reference);
    if (referenceAlpha !== null)
      screen?.renderer.setReferenceAlpha(reference.width, reference.height, referenceAlpha);
  }

  /** Linear radiance of a pixel; null outside the image. */
  radiance(x: number, y: number): Rgb | null {
    if (x < 0 || y < 0 || x >= this.pixels.width || y >= this.pixels.height) return null;
    return decodeRgb9e5(this.pixels.encoded[y * this.pixels.width + x] ?? 0);
  }

  /** Name of the material at a pixel; null for the background. */
  material(x: number, y: number): string | null {
    const { ids } = this;
    if (ids === null || x < 0 || y < 0 || x >= ids.width || y >= ids.height) return null;
    const id = ids.values[y * ids.width + x] ?? BACKGROUND;
    return id === BACKGROUND ? null : (materialNames.peek()[id] ?? null);
  }
}
