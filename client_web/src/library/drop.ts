/** A library material dragged over the picture: the object below takes it when it is dropped. It is outlined where the
 * view's eye stays; where it moves, the server knows what is there, and is asked at the drop. */
import { eyeOf } from "../cameras/eye";
import { askProbe } from "../live/probing";
import { hitAt } from "../picture/hit";
import type { Screen } from "../picture/screen";
import { hoveredMaterial } from "../state/selection";
import { attempt } from "../ui/toasts";
import { DRAG_TYPE, putOn } from "./library";

export function acceptMaterials(screen: Screen): () => void {
  const { canvas } = screen;
  const moves = () => eyeOf(screen.picture.view) !== null;
  const over = (event: DragEvent) => {
    if (!event.dataTransfer?.types.includes(DRAG_TYPE)) return;
    const { material, px, py } = hitAt(screen, event);
    hoveredMaterial.value = material;
    const mayTake = material !== null || (moves() && screen.picture.radiance(px, py) !== null);
    if (mayTake) event.preventDefault(); // the browser's word for "may be dropped here"
  };
  const drop = (event: DragEvent) => {
    const id = event.dataTransfer?.getData(DRAG_TYPE);
    const { material, px, py } = hitAt(screen, event);
    hoveredMaterial.value = null;
    if (!id || (material === null && !moves())) return;
    event.preventDefault();
    if (material !== null) putOn(material, id);
    else void attempt(async () => putOnWhatIsAt(screen.picture.view, px, py, id));
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

async function putOnWhatIsAt(view: string, x: number, y: number, id: string): Promise<void> {
  const { material } = await askProbe(view, x, y);
  if (material !== null) putOn(material, id);
}
