/** The gobo of a spot: an image that it projects. */
import { useEffect } from "preact/hooks";
import { history } from "../../../edit/history";
import type { ImageBody } from "../../../protocol";
import { ImageChoice } from "../images/ImageChoice";
import { imageUploadProgress, loadImages } from "../images/imageStore";
import { editLight } from "../../lights/lightEdits";

function setGobo(label: string, name: string, gobo: string | null): void {
  history.endGesture();
  editLight(label, name, "gobo", gobo);
}

export function GoboField({ name, gobo }: { name: string; gobo: string | null }) {
  useEffect(() => void loadImages(), [gobo]); // it may have been uploaded elsewhere
  const remove = () => setGobo("Remove gobo", name, null);
  return (
    <div class="gobo-field" role="group" aria-label="Gobo">
      <span class="param-label">Gobo</span>
      <ImageChoice
        label="Gobo image"
        title="The image that the spot projects; its cone is the circle in it."
        file="Load gobo…"
        material={name}
        displayedImage={gobo}
        assign={(light: string, image: ImageBody) => setGobo(`Gobo · ${image.name}`, light, image.texture)}
        unassign={remove}
        onOther={remove}
      >
        <option value="">None</option>
      </ImageChoice>
      {imageUploadProgress.value !== null && (
        <p class="hint" role="status">
          {imageUploadProgress.value}
        </p>
      )}
    </div>
  );
}
