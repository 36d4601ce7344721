/** The images of the open scene's views; the view state decides which are shown. */
import { brushedRange } from "../state/curvePreview";
import { shownViews, activeViewName } from "../state/views";
import { ViewImage } from "./viewImage";

class RenderStage {
  private readonly images = new Map<string, ViewImage>();

  imageOf(view: string): ViewImage {
    let image = this.images.get(view);
    if (image === undefined) this.images.set(view, (image = new ViewImage(view)));
    return image;
  }

  /** The image of the active view. */
  get active(): ViewImage {
    return this.imageOf(activeViewName.value);
  }

  get displayed(): ViewImage[] {
    return shownViews.value.map((view) => this.imageOf(view));
  }

  /** Store the shown images as A, and drop A's images of other views. */
  storeReference(): void {
    for (const image of this.images.values()) image.clearReference();
    for (const image of this.displayed) image.storeReference();
  }

  clearBrush(): void {
    for (const image of this.images.values()) image.brush = null;
    brushedRange.value = null;
  }

  /** Drop everything that belongs to a scene. */
  clear(): void {
    this.images.clear();
  }
}

export const stage = new RenderStage();
