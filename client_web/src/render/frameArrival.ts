/** The pending first image of a view, after a new bake or opening the view: held back until every material has some
 * pixels, so that no partial image replaces a complete one. */
import type { Frame } from "../session/net/binaryFrame";
import type { FrameHeader } from "../protocol";
import { applyFrame, emptyPixels, readAlpha, type PixelBuffer } from "./pixels";
import type { MaterialIds } from "./png16";

export class PendingFrame {
  pixels: PixelBuffer | null = null;
  /** Coverage of each pixel; null: opaque. */
  alpha: Uint8Array | null = null;
  /** The newest frame, if it was tone-mapped by the server. */
  jpeg: Frame | null = null;
  /** Header of the newest frame. */
  header: FrameHeader;
  ids: MaterialIds | null = null;

  constructor(first: Frame) {
    this.header = first.header;
    this.addFrame(first);
  }

  /** True once every material has some pixels. */
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

/** The views of one connection whose first image is pending. */
export class PendingFrames {
  private readonly pending = new Map<string, PendingFrame>();
  private readonly displayedViews = new Set<string>();

  /** True if frames of this view go directly to its image. */
  isDisplayed(view: string): boolean {
    return this.displayedViews.has(view);
  }

  get(view: string): PendingFrame | undefined {
    return this.pending.get(view);
  }

  /** Add a frame of a view whose image is not shown yet. */
  addFrame(frame: Frame): PendingFrame {
    const { view } = frame.header;
    let pendingFrame = this.pending.get(view);
    if (pendingFrame === undefined) this.pending.set(view, (pendingFrame = new PendingFrame(frame)));
    else pendingFrame.addFrame(frame);
    return pendingFrame;
  }

  /** Mark a view's image as shown. */
  markDisplayed(view: string): void {
    this.pending.delete(view);
    this.displayedViews.add(view);
  }

  /** Drop all views but these, as the server does. */
  retain(views: readonly string[]): void {
    for (const view of [...this.pending.keys(), ...this.displayedViews]) {
      if (views.includes(view)) continue;
      this.pending.delete(view);
      this.displayedViews.delete(view);
    }
  }
}
