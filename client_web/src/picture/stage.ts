/** The pictures of all views of the open scene that were shown; which of them are shown is the store's to say. */
import { brushed } from "../state/curveShape";
import { shownViews, viewName } from "../state/views";
import { Picture } from "./picture";

class Stage {
  private readonly pictures = new Map<string, Picture>();

  of(view: string): Picture {
    let picture = this.pictures.get(view);
    if (picture === undefined) this.pictures.set(view, (picture = new Picture(view)));
    return picture;
  }

  /** Of the view that buttons and keys mean. */
  get active(): Picture {
    return this.of(viewName.value);
  }

  get shown(): Picture[] {
    return shownViews.value.map((view) => this.of(view));
  }

  /** Keep what is shown as A; what A was in other views is another picture. */
  keepReference(): void {
    for (const picture of this.pictures.values()) picture.forgetReference();
    for (const picture of this.shown) picture.keepAsReference();
  }

  clearBrush(): void {
    for (const picture of this.pictures.values()) picture.brush = null;
    brushed.value = null;
  }

  /** Forget everything that belongs to a scene. */
  clear(): void {
    this.pictures.clear();
  }
}

export const stage = new Stage();
