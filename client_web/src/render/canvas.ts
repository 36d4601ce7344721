/** A canvas that shows one image with the view's settings. Each has its own graphics context, so that a frame redraws
 * only its view. */
import { effect, signal } from "@preact/signals";
import { soloMaterial } from "../state/visibility/soloSources";
import { canvasColor } from "../state/canvasColor";
import { displayTransform } from "../state/color";
import { brushedRange } from "../state/curvePreview";
import { difference, displayedFrames, falseColor, isDisplayFrozen, isReferenceShown, wipe } from "../state/display";
import { recordFrameShown } from "../state/latency";
import { materialNames } from "../state/scene";
import { hoveredMaterial } from "../state/selection";
import { focusedView, sideBySide } from "../state/views";
import type { DifferenceMode } from "./color/difference";
import type { ViewImage, ImagePresenter } from "./viewImage";
import { DisplayRenderer } from "./displayRenderer";
import { MARGIN_ALONE, MARGIN_GRID, displayedWidth, toScreenPoint, type CanvasGeometry } from "./zoomTransform";
import { transformOf } from "./viewTransforms";

/** The mode of the difference that an image can show: both sides must have radiance. */
const differenceOf = ({ reference, display }: ViewImage, mode: DifferenceMode): DifferenceMode =>
  reference === null || display !== null ? "off" : mode;

const MAX_WAIT_MS = 250;
const SURROUND: [number, number, number] = [0.078, 0.078, 0.078];

export class ImageCanvas implements ImagePresenter {
  readonly renderer: DisplayRenderer;
  /** True while the graphics context is lost. */
  readonly isLost = signal(false);
  private box: [width: number, height: number] = [1, 1];
  /** True until something is drawn after creating or resizing the canvas. */
  private blank = true;
  private hasDrawnThisFrame = false;
  private queued = false;
  private closed = false;
  private waiting: (() => void)[] = [];
  private readonly stop: () => void;

  /** Throws if the browser has no WebGL2. */
  constructor(
    readonly canvas: HTMLCanvasElement,
    private current: ViewImage,
  ) {
    this.renderer = new DisplayRenderer(canvas);
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault(); // otherwise the context is never restored
      this.isLost.value = true;
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.isLost.value = false;
      this.renderer.restore();
      this.upload();
    });
    this.setImage(current);
    this.stop = effect(() => {
      this.settings();
      this.redraw();
    });
  }

  get image(): ViewImage {
    return this.current;
  }

  /** Show this image from now on. */
  setImage(image: ViewImage): void {
    if (this.current.screen === this) this.current.screen = null;
    this.current = image;
    image.screen = this;
    this.upload();
  }

  /** The canvas is removed. */
  close(): void {
    this.closed = true;
    this.stop();
    if (this.current.screen === this) this.current.screen = null;
    for (const done of this.waiting.splice(0)) done();
    this.renderer.release();
  }

  private upload(): void {
    const { renderer, current } = this;
    const { width, height } = current.pixels;
    renderer.setImage(current.pixels);
    current.showReference();
    if (current.ids !== null) renderer.setIds(current.ids.width, current.ids.height, current.ids.values);
    if (current.brush !== null) renderer.setBrush(width, height, current.brush);
    if (current.alpha !== null) renderer.setAlpha(width, height, current.alpha);
    if (current.display !== null) renderer.setDisplay(current.display);
    this.redraw();
  }

  /** Draw a new frame immediately; a second one in the same animation frame waits for the next. Resolves when drawn, so
   * that acknowledgments keep the server at the screen's pace. */
  present(): Promise<void> {
    if (!this.hasDrawnThisFrame || document.hidden) {
      this.draw();
      return Promise.resolve();
    }
    this.redraw();
    // hidden tabs get no animation frames
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

  /** The canvas was resized, in CSS pixels: stored, because querying the size forces a layout. */
  resize(width: number, height: number): void {
    this.box = [Math.max(1, width), Math.max(1, height)];
    this.blank = true;
    this.redraw();
  }

  size(): CanvasGeometry {
    const [width, height] = this.box;
    const margin = sideBySide.value ? MARGIN_GRID : MARGIN_ALONE;
    return { width, height, aspect: this.current.aspect, margin };
  }

  private settings() {
    const { reference, ids, brush, view } = this.current;
    const hovered = hoveredMaterial.value;
    const soloName = soloMaterial.value;
    const { isOn, position } = wipe.value;
    const displaysA = isReferenceShown.value; // read even without an A: the redraw effect depends on signals that were read
    return {
      held: isDisplayFrozen.value,
      transform: transformOf(view),
      display: displayTransform.value,
      falseColor: falseColor.value,
      difference: differenceOf(this.current, difference.value),
      wipe: reference === null ? -1 : displaysA ? 2 : isOn ? position : -1,
      hover: hovered === null || ids === null ? -1 : materialNames.value.indexOf(hovered),
      solo: soloName === null || ids === null ? -1 : materialNames.value.indexOf(soloName),
      brush: brushedRange.value !== null && brush !== null,
      canvasColor: canvasColor.value,
    };
  }

  private draw(): void {
    const { renderer, current } = this;
    const { held: isDisplayFrozen, transform, ...settings } = this.settings();
    // the previous content stays until there is a new image
    if (this.closed || isDisplayFrozen || (!current.hasPixels && !this.blank)) return;
    const size = this.size();
    const ratio = renderer.canvas.width / size.width;
    const width = displayedWidth(transform, size);
    const [left, top] = toScreenPoint(transform, size, 0, 0);
    renderer.draw({
      ...settings,
      transform: [Math.round(left * ratio), Math.round(top * ratio), width * ratio, (width * ratio) / current.aspect],
      displayReferred: current.display !== null,
      transparent: current.alpha !== null,
      transparentReference: current.referenceAlpha !== null,
      surround: SURROUND,
    });
    this.blank = false;
    if (current.view === focusedView.peek()) recordFrameShown(current.revision);
    displayedFrames.value += 1;
    this.hasDrawnThisFrame = true;
    requestAnimationFrame(() => (this.hasDrawnThisFrame = false));
  }
}
