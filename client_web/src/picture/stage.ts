/** The picture on the canvas: takes frames, keeps them, draws them under the current view settings. */
import { effect } from "@preact/signals";
import type { Frame } from "../net/frame";
import type { Rgb } from "../protocol";
import { frameDrawn } from "../state/stats";
import * as store from "../state/store";
import { applyFrame, brushImage, copyPixels, emptyPixels, normalised, type Pixels } from "./pixels";
import type { Ids } from "./png16";
import { Renderer } from "./renderer";
import { decodeRgb9e5 } from "./rgb9e5";
import { shownWidth, toScreen, type Canvas } from "./transform";

const MAX_WAIT_MS = 250;
const BACKGROUND = 65535;
const SURROUND: [number, number, number] = [0.078, 0.078, 0.078];

class Stage {
  private renderer: Renderer | null = null;
  private pixels: Pixels = emptyPixels(1, 1);
  private reference: Pixels | null = null;
  private ids: Ids | null = null;
  private brush: Uint8Array | null = null;
  private display: ImageBitmap | null = null;
  private box: [width: number, height: number] = [1, 1];
  private revision = 0;
  private drawnThisFrame = false;
  private queued = false;
  private waiting: (() => void)[] = [];
  /** While a frame of another look is fetched, the canvas keeps what it shows. */
  held = false;

  attach(canvas: HTMLCanvasElement): () => void {
    this.renderer = new Renderer(canvas);
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => this.restore());
    this.upload();
    const stop = effect(() => {
      this.settings();
      this.redraw();
    });
    return () => {
      stop();
      this.renderer = null;
    };
  }

  private restore(): void {
    this.renderer?.restore();
    this.upload();
    this.redraw();
  }

  private upload(): void {
    const { renderer } = this;
    if (renderer === null) return;
    renderer.setPicture(this.pixels);
    if (this.reference !== null) renderer.setReference(this.reference);
    if (this.ids !== null) renderer.setIds(this.ids.width, this.ids.height, this.ids.values);
    if (this.brush !== null) renderer.setBrush(this.pixels.width, this.pixels.height, this.brush);
    if (this.display !== null) renderer.setDisplay(this.display);
  }

  /** Take a frame of a session and draw it; a picture of another size replaces what was there. */
  async show(frame: Frame): Promise<void> {
    const { width, height, kind, format, revision } = frame.header;
    if (kind === "brush") return this.showBrush(frame);
    if (format === "jpeg") return this.showJpeg(frame);
    if (this.pixels.width !== width || this.pixels.height !== height) {
      this.pixels = emptyPixels(width, height);
      this.brush = null;
      this.renderer?.setPicture(this.pixels);
    }
    if (frame.header.tiles.length > 0) {
      this.display = null;
      this.uploadTiles(frame);
    }
    this.revision = revision;
    return this.present();
  }

  private uploadTiles(frame: Frame): void {
    const tiles = applyFrame(this.pixels, frame);
    // one big upload is quicker than many small ones of the same size
    const area = tiles.reduce((sum, { words }) => sum + words.length, 0);
    if (area > this.pixels.words.length / 2) this.renderer?.updatePicture(this.pixels);
    else this.renderer?.uploadTiles(tiles);
  }

  private showBrush(frame: Frame): void {
    if (store.brushed.peek() === null) return;
    this.brush = normalised(brushImage(frame));
    this.renderer?.setBrush(frame.header.width, frame.header.height, this.brush);
    this.redraw();
  }

  private async showJpeg(frame: Frame): Promise<void> {
    const blob = new Blob([frame.payload as BlobPart], { type: "image/jpeg" });
    this.display = await createImageBitmap(blob, { colorSpaceConversion: "none" });
    this.renderer?.setDisplay(this.display);
    this.revision = frame.header.revision;
    return this.present();
  }

  /** Draw a new frame at once; a second one in the same animation frame waits for the next. Resolves when it is drawn,
   * so that acknowledgements keep the server at the screen's pace. */
  private present(): Promise<void> {
    if (!this.drawnThisFrame || document.hidden) {
      this.draw();
      return Promise.resolve();
    }
    this.redraw();
    // a tab that is hidden meanwhile gets no animation frames
    return new Promise((done) => {
      this.waiting.push(done);
      window.setTimeout(done, MAX_WAIT_MS);
    });
  }

  redraw(): void {
    if (this.queued) return;
    this.queued = true;
    requestAnimationFrame(() => {
      this.queued = false;
      this.draw();
      for (const done of this.waiting.splice(0)) done();
    });
  }

  /** The canvas has another size, in CSS pixels: remembered, because asking makes the browser lay out the page. */
  resize(width: number, height: number): void {
    this.box = [Math.max(1, width), Math.max(1, height)];
    this.redraw();
  }

  canvasSize(): Canvas {
    const [width, height] = this.box;
    return { width, height, aspect: this.aspect };
  }

  get aspect(): number {
    return this.pixels.width / this.pixels.height;
  }

  get hasPicture(): boolean {
    return this.pixels.width > 1 || this.display !== null;
  }

  /** Forget everything that belongs to a scene. */
  clear(): void {
    this.pixels = emptyPixels(1, 1);
    this.reference = this.ids = this.brush = this.display = null;
    this.renderer?.setPicture(this.pixels);
    this.redraw();
  }

  get size(): [width: number, height: number] {
    return [this.pixels.width, this.pixels.height];
  }

  private settings() {
    const transform = store.transform.value;
    const hovered = store.hoveredMaterial.value;
    const alone = store.solo.value;
    const { on, at } = store.wipe.value;
    return {
      transform,
      exposure: store.exposure.value,
      toneMap: store.toneMap.value,
      falseColour: store.falseColour.value,
      wipe: this.reference === null ? -1 : store.showBefore.value ? 2 : on ? at : -1,
      hover: hovered === null || this.ids === null ? -1 : store.materialNames.value.indexOf(hovered),
      solo: alone === null || this.ids === null ? -1 : store.materialNames.value.indexOf(alone),
      brush: store.brushed.value !== null && this.brush !== null,
    };
  }

  private draw(): void {
    const { renderer } = this;
    if (renderer === null || this.held) return;
    const canvas = this.canvasSize();
    const ratio = renderer.canvas.width / canvas.width;
    const { transform, ...settings } = this.settings();
    const width = shownWidth(transform, canvas);
    const [left, top] = toScreen(transform, canvas, 0, 0);
    renderer.draw({
      ...settings,
      place: [Math.round(left * ratio), Math.round(top * ratio), width * ratio, (width * ratio) / this.aspect],
      displayReferred: this.display !== null,
      surround: SURROUND,
    });
    frameDrawn(this.revision);
    store.drawn.value += 1;
    this.drawnThisFrame = true;
    requestAnimationFrame(() => (this.drawnThisFrame = false));
  }

  setIds(ids: Ids | null): void {
    this.ids = ids;
    if (ids !== null) this.renderer?.setIds(ids.width, ids.height, ids.values);
    this.redraw();
  }

  clearBrush(): void {
    this.brush = null;
    store.brushed.value = null;
  }

  /** A copy of the picture as it is. */
  capture(): Pixels {
    return copyPixels(this.pixels);
  }

  setReference(pixels: Pixels | null): void {
    this.reference = pixels;
    if (pixels !== null) this.renderer?.setReference(pixels);
    this.redraw();
  }

  /** RGB9_E5 words of the picture, not to be changed. */
  get words(): Uint32Array {
    return this.pixels.words;
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
    return id === BACKGROUND ? null : (store.materialNames.peek()[id] ?? null);
  }
}

export const stage = new Stage();
