/** Files held over the picture: the object below is outlined, and takes the images among those that are dropped on it. */
import { eyeOf } from "../cameras/eye";
import { askProbe } from "../live/probing";
import { hitAt } from "../picture/hit";
import type { Screen } from "../picture/screen";
import { hoveredMaterial } from "../state/selection";
import { IMAGE_TYPES, letGoOver } from "./taking";

const holdsFiles = ({ dataTransfer }: DragEvent): boolean => dataTransfer?.types.includes("Files") ?? false;

/** Whether there may be images among them: a folder has no type, and shows its files only when it is dropped. */
function mayHoldImages({ dataTransfer }: DragEvent): boolean {
  return [...(dataTransfer?.items ?? [])].some(({ kind, type }) => kind === "file" && (type === "" || IMAGE_TYPES.includes(type)));
}

export function acceptImages(screen: Screen): () => void {
  const { canvas } = screen;
  const over = (event: DragEvent) => {
    if (mayHoldImages(event)) hoveredMaterial.value = hitAt(screen, event).material;
  };
  const drop = (event: DragEvent) => {
    if (!holdsFiles(event)) return;
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
