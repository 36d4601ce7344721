/** Draws the free-camera views of one bake in this browser, each from its newest camera, one image at a time. */
import { MAX_CAMERA_PIXELS, type FrameHeader } from "../protocol";
import type { FreeCameraRenderer } from "../render/freeCamera/freeCameraRenderer";
import { recordClientFrame } from "../state/latency";
import { views } from "../state/views";
import { showFrame } from "./bakeSwap";
import type { BakeConnection } from "./connections";
import type { Frame } from "./net/binaryFrame";

const NUM_TIMINGS = 8;

/** Image size of a free-camera view. */
export function limitRenderSize(width: number, height: number): [number, number] {
  const scale = Math.min(1, Math.sqrt(MAX_CAMERA_PIXELS / (width * height)));
  return [Math.floor(width * scale), Math.floor(height * scale)];
}

/** A view as drawn here. */
class RenderedView {
  /** Header of the last tables; null before. */
  header: FrameHeader | null = null;
  /** True while this browser draws the camera's motion. */
  isMoving = false;
  /** True if a newer server image came while an older one was being drawn. */
  isSuperseded = false;
  /** Waiters for the next image. Continuous input must not block acknowledgments. */
  private waiters: (() => void)[] = [];

  untilDrawn(): Promise<void> {
    return new Promise((done) => this.waiters.push(done));
  }

  /** A new image is drawn; returns its waiters. */
  begin(): (() => void)[] {
    this.isSuperseded = false;
    return this.takeWaiters();
  }

  takeWaiters(): (() => void)[] {
    return this.waiters.splice(0);
  }
}

export class ClientRenderer {
  private readonly renderedViews = new Map<string, RenderedView>();
  /** Names of views to draw, the one that waits longest first. */
  private readonly staleViews = new Set<string>();
  private loop: Promise<void> | null = null;
  private durations: number[] = [];
  private isDisposed = false;
  /** Resolves when the array for lobes is loaded. */
  private lobeLightsLoading: Promise<void> | null = null;

  /** `loadLobeLights` loads the array needed only for lobes, larger than all others; `onDrawn` receives the median time
   * of the last images in milliseconds, once there are enough; `onFailed` a failure to draw. */
  constructor(
    readonly connection: BakeConnection,
    private readonly gpu: FreeCameraRenderer,
    private readonly loadLobeLights: () => Promise<void>,
    private readonly onDrawn: (medianMs: number) => void,
    private readonly onFailed: (error: unknown) => void,
  ) {}

  get isSoftware(): boolean {
    return this.gpu.isSoftware;
  }

  get isLost(): boolean {
    return this.gpu.isLost;
  }

  isMoving(view: string): boolean {
    return this.renderedViews.get(view)?.isMoving ?? false;
  }

  setMoving(view: string, isMoving: boolean): void {
    this.viewOf(view).isMoving = isMoving;
  }

  /** True if a view can be drawn with the current look. */
  canDraw(view: string): boolean {
    const { session } = this.connection;
    return this.gpu.isReady && !session.hasPendingEdits && this.viewOf(view).header?.revision === session.revision;
  }

  /** Forget the tables' headers: the server sends them again. */
  clearTables(): void {
    for (const view of this.renderedViews.values()) view.header = null;
  }

  /** A newer image of the server replaces what is to be drawn, or is being drawn. */
  supersede(view: string): void {
    this.viewOf(view).isSuperseded = true;
    this.staleViews.delete(view);
  }

  /** Apply a look's tables and draw their view; resolves when it has been drawn once, or cannot be. */
  async applyTables({ header, payload }: Frame): Promise<void> {
    if (header.scene_update === null) return;
    this.gpu.setTables(header.scene_update, payload);
    this.viewOf(header.view).header = header;
    if (this.gpu.lacksVisibleLights) {
      try {
        await (this.lobeLightsLoading ??= this.loadLobeLights());
      } catch (error) {
        return this.fail(error);
      }
    }
    return this.draw(header.view);
  }

  /** Draw a view from its newest camera; resolves when it has been drawn once, or cannot be. */
  draw(view: string): Promise<void> {
    this.staleViews.add(view);
    const drawn = this.viewOf(view).untilDrawn();
    this.loop ??= this.drawStaleViews().finally(() => {
      this.loop = null;
      for (const each of this.renderedViews.values()) for (const done of each.takeWaiters()) done();
    });
    return drawn;
  }

  /** Stop drawing and release the graphics context. */
  dispose(): void {
    this.isDisposed = true;
    this.staleViews.clear();
    this.gpu.dispose();
  }

  private viewOf(name: string): RenderedView {
    const existing = this.renderedViews.get(name) ?? new RenderedView();
    this.renderedViews.set(name, existing);
    return existing;
  }

  private async drawStaleViews(): Promise<void> {
    for (const name of this.staleViews) {
      this.staleViews.delete(name);
      if (!(await this.drawNow(name, this.viewOf(name)))) return;
    }
  }

  /** Draw and show a view; false if that failed. */
  private async drawNow(name: string, view: RenderedView): Promise<boolean> {
    const start = performance.now();
    const waiters = view.begin();
    try {
      const frame = await this.drawFrame(name, view);
      if (frame !== null && !this.isDisposed && !view.isSuperseded) await showFrame(this.connection, frame);
    } catch (error) {
      this.fail(error);
      return false;
    } finally {
      for (const done of waiters) done();
    }
    if (!this.isDisposed) this.recordDuration(performance.now() - start);
    return true;
  }

  /** The image as a frame of the server; null if the view is not shown or has no tables. */
  private async drawFrame(name: string, { header }: RenderedView): Promise<Frame | null> {
    const view = views.peek().find((candidate) => candidate.name === name);
    if (view === undefined || header === null) return null;
    const { width, height, encoded, coverage } = await this.gpu.draw(view.camera, ...limitRenderSize(view.width, view.height));
    recordClientFrame();
    const fullFrame = { tiles: [[0, 0, width, height]] as FrameHeader["tiles"], format: "rgb9e5" as const, kind: "picture" as const };
    return { header: { ...header, ...fullFrame, width, height, alpha: coverage !== null, scene_update: null }, payload: encoded, alpha: coverage };
  }

  private recordDuration(ms: number): void {
    this.durations = [...this.durations.slice(1 - NUM_TIMINGS), ms];
    const median = [...this.durations].sort((a, b) => a - b)[NUM_TIMINGS >> 1];
    if (this.durations.length === NUM_TIMINGS && median !== undefined) this.onDrawn(median);
  }

  private fail(error: unknown): void {
    if (!this.isDisposed) this.onFailed(error);
  }
}
