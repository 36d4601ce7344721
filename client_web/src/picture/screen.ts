/** A canvas that shows one picture, as the view's settings say. Each has a graphics context of its own: a frame of one
 * view then draws that view alone, where a shared canvas would have to draw all of them again. */
import { effect, signal } from "@preact/signals";
import { solo } from "../seen/solo";
import { toneMap } from "../state/color";
import { brushed } from "../state/curveShape";
import { drawn, falseColour, held, showBefore, wipe } from "../state/display";
import { frameDrawn } from "../state/latency";
import { exposure } from "../state/look";
import { materialNames } from "../state/scene";
import { hoveredMaterial } from "../state/selection";
import { focusedView, sideBySide } from "../state/views";
import type { Picture, Shows } from "./picture";
import { Renderer } from "./renderer";
import { MARGIN_ALONE, MARGIN_BESIDE, shownWidth, toScreen, type Canvas } from "./transform";
import { transformOf } from "./viewTransforms";

const MAX_WAIT_MS = 250;
const SURROUND: [number, number, number] = [0.078, 0.078, 0.078];

export class Screen implements Shows {
  readonly renderer: Renderer;
  /** The browser took the graphics memory away, and has not given it back yet. */
  readonly isLost = signal(false);
  private box: [width: number, height: number] = [1, 1];
  /** Nothing has been drawn since the canvas was made or got another size. */
  private blank = true;
  private drawnThisFrame = false;
  private queued = false;
  private closed = false;
  private waiting: (() => void)[] = [];
  private readonly stop: () => void;

  /** Throws where the browser has no WebGL2. */
  constructor(
    readonly canvas: HTMLCanvasElement,
    private shown: Picture,
  ) {
    this.renderer = new Renderer(canvas);
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault(); // else it would never come back
      this.isLost.value = true;
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.isLost.value = false;
      this.renderer.restore();
      this.upload();
    });
    this.take(shown);
    this.stop = effect(() => {
      this.settings();
      this.redraw();
    });
  }

  get picture(): Picture {
    return this.shown;
  }

  /** Show this picture from now on. */
  take(picture: Picture): void {
    if (this.shown.screen === this) this.shown.screen = null;
    this.shown = picture;
    picture.screen = this;
    this.upload();
  }

  /** The canvas goes away. */
  close(): void {
    this.closed = true;
    this.stop();
    if (this.shown.screen === this) this.shown.screen = null;
    for (const done of this.waiting.splice(0)) done();
    this.renderer.release();
  }

  private upload(): void {
    const { renderer, shown } = this;
    const { width, height } = shown.pixels;
    renderer.setPicture(shown.pixels);
    shown.showReference();
    if (shown.ids !== null) renderer.setIds(shown.ids.width, shown.ids.height, shown.ids.values);
    if (shown.brush !== null) renderer.setBrush(width, height, shown.brush);
    if (shown.alpha !== null) renderer.setAlpha(width, height, shown.alpha);
    if (shown.display !== null) renderer.setDisplay(shown.display);
    this.redraw();
  }

  /** Draw a new frame at once; a second one in the same animation frame waits for the next. Resolves when it is drawn,
   * so that acknowledgements keep the server at the screen's pace. */
  present(): Promise<void> {
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
    this.blank = true;
    this.redraw();
  }

  size(): Canvas {
    const [width, height] = this.box;
    const margin = sideBySide.value ? MARGIN_BESIDE : MARGIN_ALONE;
    return { width, height, aspect: this.shown.aspect, margin };
  }

  private settings() {
    const { reference, ids, brush, view } = this.shown;
    const hovered = hoveredMaterial.value;
    const alone = solo.value;
    const { on, at } = wipe.value;
    const before = showBefore.value; // read also while there is no A yet: a redraw follows what was read
    return {
      held: held.value,
      transform: transformOf(view),
      exposure: exposure.value,
      toneMap: toneMap.value,
      falseColour: falseColour.value,
      wipe: reference === null ? -1 : before ? 2 : on ? at : -1,
      hover: hovered === null || ids === null ? -1 : materialNames.value.indexOf(hovered),
      solo: alone === null || ids === null ? -1 : materialNames.value.indexOf(alone),
      brush: brushed.value !== null && brush !== null,
    };
  }

  private draw(): void {
    const { renderer, shown } = this;
    const { held, transform, ...settings } = this.settings();
    // what was there stays until there is something else
    if (this.closed || held || (!shown.isThere && !this.blank)) return;
    const size = this.size();
    const ratio = renderer.canvas.width / size.width;
    const width = shownWidth(transform, size);
    const [left, top] = toScreen(transform, size, 0, 0);
    renderer.draw({
      ...settings,
      place: [Math.round(left * ratio), Math.round(top * ratio), width * ratio, (width * ratio) / shown.aspect],
      displayReferred: shown.display !== null,
      transparent: shown.alpha !== null,
      transparentReference: shown.referenceAlpha !== null,
      surround: SURROUND,
    });
    this.blank = false;
    if (shown.view === focusedView.peek()) frameDrawn(shown.revision);
    drawn.value += 1;
    this.drawnThisFrame = true;
    requestAnimationFrame(() => (this.drawnThisFrame = false));
  }
}
