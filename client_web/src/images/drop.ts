/** Images held over the picture: the object below is outlined, and takes what is dropped on it. */
import { eyeOf } from "../cameras/eye";
import { askProbe } from "../live/probing";
import { hitAt } from "../picture/hit";
import type { Screen } from "../picture/screen";
import { hoveredMaterial } from "../state/selection";
import { IMAGE_TYPES, letGoOver } from "./images";

function holdsImage({ dataTransfer }: DragEvent): boolean {
  return [...(dataTransfer?.items ?? [])].some(({ kind, type }) => kind === "file" && IMAGE_TYPES.includes(type));
}

export function acceptImages(screen: Screen): () => void {
  const { canvas } = screen;
  const over = (event: DragEvent) => {
    if (holdsImage(event)) hoveredMaterial.value = hitAt(screen, event).material;
  };
  const drop = (event: DragEvent) => {
    if (!holdsImage(event)) return;
    const { px, py, material } = hitAt(screen, event);
    const { view } = screen.picture;
    hoveredMaterial.value = null;
    // where the eye moves, the server knows; the page takes the files when the event comes to it
    letGoOver(eyeOf(view) === null ? Promise.resolve(material) : askProbe(view, px, py).then((answer) => answer.material));
  };
  canvas.addEventListener("dragover", over);
  canvas.addEventListener("drop", drop);
  return () => {
    canvas.removeEventListener("dragover", over);
    canvas.removeEventListener("drop", drop);
  };
}
