/** A library material dragged over the picture: the object below is outlined, and takes it when it is dropped. */
import { hitAt } from "../picture/hit";
import type { Screen } from "../picture/screen";
import { hoveredMaterial } from "../state/selection";
import { DRAG_TYPE, putOn } from "./library";

export function acceptMaterials(screen: Screen): () => void {
  const { canvas } = screen;
  const over = (event: DragEvent) => {
    if (!event.dataTransfer?.types.includes(DRAG_TYPE)) return;
    const { material } = hitAt(screen, event);
    hoveredMaterial.value = material;
    if (material !== null) event.preventDefault(); // the browser's word for "may be dropped here"
  };
  const drop = (event: DragEvent) => {
    const id = event.dataTransfer?.getData(DRAG_TYPE);
    const { material } = hitAt(screen, event);
    hoveredMaterial.value = null;
    if (!id || material === null) return;
    event.preventDefault();
    putOn(material, id);
  };
  const leave = () => (hoveredMaterial.value = null);
  canvas.addEventListener("dragover", over);
  canvas.addEventListener("drop", drop);
  canvas.addEventListener("dragleave", leave);
  return () => {
    canvas.removeEventListener("dragover", over);
    canvas.removeEventListener("drop", drop);
    canvas.removeEventListener("dragleave", leave);
  };
}
