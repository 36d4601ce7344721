/** Files dragged over the image: the object below is outlined, and receives the dropped images. */
import { freeCameraOf } from "../../../viewport/cameras/freeCamera";
import { requestPixelProbe } from "../../../session/pixelProbe";
import { pickMaterial } from "../../../render/materialPicking";
import type { ImageCanvas } from "../../../render/canvas";
import { hoveredMaterial } from "../../../state/selection";
import { onDrop } from "./importImages";

const hasFiles = ({ dataTransfer }: DragEvent): boolean => dataTransfer?.types.includes("Files") ?? false;

/** True if images may be among the dragged files: a folder has no type, and reveals its files only on drop. */
function mayHoldImages({ dataTransfer }: DragEvent): boolean {
  return [...(dataTransfer?.items ?? [])].some(
    ({ kind, type }) => kind === "file" && (type === "" || type.startsWith("image/")),
  );
}

export function acceptImageDrops(screen: ImageCanvas): () => void {
  const { canvas } = screen;
  const target = (event: DragEvent) => {
    if (mayHoldImages(event)) hoveredMaterial.value = pickMaterial(screen, event).material;
  };
  const drop = (event: DragEvent) => {
    if (!hasFiles(event)) return;
    const { px, py, material } = pickMaterial(screen, event);
    const { view } = screen.image;
    hoveredMaterial.value = null;
    // in free-camera views the server picks the material; the page handles the files when the event bubbles up
    onDrop(
      freeCameraOf(view) === null
        ? Promise.resolve(material)
        : requestPixelProbe(view, px, py).then((answer) => answer.material),
    );
  };
  canvas.addEventListener("dragover", target);
  canvas.addEventListener("drop", drop);
  return () => {
    canvas.removeEventListener("dragover", target);
    canvas.removeEventListener("drop", drop);
  };
}
