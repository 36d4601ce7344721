/** The pending first image of a view, of a new bake or after a view was opened: held back until something of
 * every material is there, so that no partial image replaces a complete one. */
import type { Frame } from "../session/net/binaryFrame";
import type { FrameHeader } from "../protocol";
import { applyFrame, emptyPixels, readAlpha, type PixelBuffer } from "./pixels";
import type { MaterialIds } from "./png16";

export class PendingFrame {
  pixels: PixelBuffer | null = null;
  /** How much each pixel hides of what is behind it; null: all. */
  alpha: Uint8Array | null = null;
  /** What came last, where that was tone-mapped by the server. */
  jpeg: Frame | null = null;
  /** Of the newest frame. */
  header: FrameHeader;
  ids: MaterialIds | null = null;

  constructor(first: Frame) {
    this.header = first.header;
    this.addFrame(first);
  }

  /** Something of every material has come. */
  get isComplete(): boolean {
    return this.header.complete;
  }

  addFrame(frame: Frame): void {
    const { width, height, format } = frame.header;
    if (format === "jpeg") this.jpeg = frame;
    else {
      if (this.pixels?.width !== width || this.pixels.height !== height) this.pixels = emptyPixels(width, height);
      applyFrame(this.pixels, frame);
      this.alpha = readAlpha(this.alpha, frame);
      this.jpeg = null;
    }
    this.header = frame.header;
  }
}

/** Of one connection: the views whose first image is pending. */
export class PendingFrames {
  private readonly pending = new Map<string, PendingFrame>();
  private readonly displayedViews = new Set<string>();

  /** Frames of this view go to its image. */
  isDisplayed(view: string): boolean {
    return this.displayedViews.has(view);
  }

  get(view: string): PendingFrame | undefined {
    return this.pending.get(view);
  }

  /** Add a frame of a view that is not shown yet. */
  addFrame(frame: Frame): PendingFrame {
    const { view } = frame.header;
    let pendingFrame = this.pending.get(view);
    if (pendingFrame === undefined) this.pending.set(view, (pendingFrame = new PendingFrame(frame)));
    else pendingFrame.addFrame(frame);
    return pendingFrame;
  }

  /** A view's image is shown from now on. */
  markDisplayed(view: string): void {
    this.pending.delete(view);
    this.displayedViews.add(view);
  }

  /** The server has forgotten all views but these. */
  retain(views: readonly string[]): void {
    for (const view of [...this.pending.keys(), ...this.displayedViews]) {
      if (views.includes(view)) continue;
      this.pending.delete(view);
      this.displayedViews.delete(view);
    }
  }
}
