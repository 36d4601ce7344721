/** Drops a library material on the object below the pointer. With a fixed camera the object is outlined; in free-camera
 * views the server picks the object at the drop. */
import { freeCameraOf } from "../../viewport/cameras/freeCamera";
import { requestPixelProbe } from "../../session/pixelProbe";
import { pickMaterial } from "../../render/materialPicking";
import type { ImageCanvas } from "../../render/canvas";
import { hoveredMaterial } from "../../state/selection";
import { reportErrors } from "../../ui/toasts";
import { DRAG_TYPE, applyEntry } from "./libraryItems";

export function acceptMaterialDrops(screen: ImageCanvas): () => void {
  const { canvas } = screen;
  const moves = () => freeCameraOf(screen.image.view) !== null;
  const hitAt = (event: DragEvent) => {
    if (!event.dataTransfer?.types.includes(DRAG_TYPE)) return;
    const { material, px, py } = pickMaterial(screen, event);
    hoveredMaterial.value = material;
    const canDrop = material !== null || (moves() && screen.image.radiance(px, py) !== null);
    if (canDrop) event.preventDefault(); // tells the browser that dropping is allowed
  };
  const drop = (event: DragEvent) => {
    const id = event.dataTransfer?.getData(DRAG_TYPE);
    const { material, px, py } = pickMaterial(screen, event);
    hoveredMaterial.value = null;
    if (!id || (material === null && !moves())) return;
    event.preventDefault();
    if (material !== null) applyEntry(material, id);
    else void reportErrors(async () => applyAtPointer(screen.image.view, px, py, id));
  };
  const onLeave = () => (hoveredMaterial.value = null);
  canvas.addEventListener("dragover", hitAt);
  canvas.addEventListener("drop", drop);
  canvas.addEventListener("dragleave", onLeave);
  return () => {
    canvas.removeEventListener("dragover", hitAt);
    canvas.removeEventListener("drop", drop);
    canvas.removeEventListener("dragleave", onLeave);
  };
}

async function applyAtPointer(view: string, x: number, y: number, id: string): Promise<void> {
  const { material } = await requestPixelProbe(view, x, y);
  if (material !== null) applyEntry(material, id);
}
