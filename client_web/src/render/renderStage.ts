/** The images of all views of the open scene that were shown; which of them are shown is the store's to say. */
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

  /** Of the view that buttons and keys mean. */
  get active(): ViewImage {
    return this.imageOf(activeViewName.value);
  }

  get displayed(): ViewImage[] {
    return shownViews.value.map((view) => this.imageOf(view));
  }

  /** Keep what is shown as A; what A was in other views is another image. */
  storeReference(): void {
    for (const image of this.images.values()) image.clearReference();
    for (const image of this.displayed) image.storeReference();
  }

  clearBrush(): void {
    for (const image of this.images.values()) image.brush = null;
    brushedRange.value = null;
  }

  /** Forget everything that belongs to a scene. */
  clear(): void {
    this.images.clear();
  }
}

export const stage = new RenderStage();
