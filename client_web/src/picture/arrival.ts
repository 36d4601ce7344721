/** The first picture of a view on its way, of a new bake or after a view was opened: kept aside until something of
 * every material is there, so that no half picture takes the place of a whole one. */
import type { Frame } from "../net/binaryFrame";
import type { FrameHeader } from "../protocol";
import { applyFrame, emptyPixels, takeAlpha, type Pixels } from "./pixels";
import type { Ids } from "./png16";

export class Arrival {
  pixels: Pixels | null = null;
  /** How much each pixel hides of what is behind it; null: all. */
  alpha: Uint8Array | null = null;
  /** What came last, where that was tone-mapped by the server. */
  jpeg: Frame | null = null;
  /** Of the newest frame. */
  header: FrameHeader;
  ids: Ids | null = null;

  constructor(first: Frame) {
    this.header = first.header;
    this.take(first);
  }

  /** Something of every material has come. */
  get isWhole(): boolean {
    return this.header.complete;
  }

  take(frame: Frame): void {
    const { width, height, format } = frame.header;
    if (format === "jpeg") this.jpeg = frame;
    else {
      if (this.pixels?.width !== width || this.pixels.height !== height) this.pixels = emptyPixels(width, height);
      applyFrame(this.pixels, frame);
      this.alpha = takeAlpha(this.alpha, frame);
      this.jpeg = null;
    }
    this.header = frame.header;
  }
}

/** Of one connection: the views whose first picture is on its way. */
export class Arrivals {
  private readonly coming = new Map<string, Arrival>();
  private readonly shown = new Set<string>();

  /** Frames of this view go to its picture. */
  isShown(view: string): boolean {
    return this.shown.has(view);
  }

  get(view: string): Arrival | undefined {
    return this.coming.get(view);
  }

  /** Add a frame of a view that is not shown yet. */
  take(frame: Frame): Arrival {
    const { view } = frame.header;
    let arrival = this.coming.get(view);
    if (arrival === undefined) this.coming.set(view, (arrival = new Arrival(frame)));
    else arrival.take(frame);
    return arrival;
  }

  /** A view's picture is shown from now on. */
  show(view: string): void {
    this.coming.delete(view);
    this.shown.add(view);
  }

  /** The server has forgotten all views but these. */
  keep(views: readonly string[]): void {
    for (const known of [...this.coming.keys(), ...this.shown]) {
      if (views.includes(known)) continue;
      this.coming.delete(known);
      this.shown.delete(known);
    }
  }
}
