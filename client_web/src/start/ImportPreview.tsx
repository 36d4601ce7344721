/** What an import made of a file: clay picture, size, and options to import the file again. */
import type { SceneBody } from "../protocol";
import { clayUrl } from "../session/net/api";
import { ClayImage } from "../ui/ClayImage";
import { ImportOptionsForm } from "./ImportOptionsForm";
import { optionsText } from "./importOptions";
import { formatSize, sizeDoubt } from "./sceneSize";
import type { Reimport } from "./useReimport";

const CLAY_WIDTH = 480;

interface ImportPreviewProps {
  scene: SceneBody;
  /** Null if the page does not have the file. */
  reimport: Reimport | null;
  /** Called when the clay picture has arrived. */
  onDrawn: () => void;
}

function SizeText({ size }: { size: NonNullable<SceneBody["size"]> }) {
  const doubt = sizeDoubt(size);
  return (
    <>
      <p>
        <b class="scene-size">{formatSize(size)}</b> <span class="quiet">width × height × depth</span>
      </p>
      {doubt !== null && <p class="doubt">{doubt}</p>}
    </>
  );
}

export function ImportPreview({ scene, reimport, onDrawn }: ImportPreviewProps) {
  const used = optionsText(scene.import_options);
  return (
    <div class="import-preview">
      <figure>
        <ClayImage url={clayUrl(scene.id, CLAY_WIDTH)} label={`Clay picture of ${scene.name}`} onSettled={onDrawn} />
        <figcaption class="quiet">Clay picture: shape only. Up in the picture is +Y.</figcaption>
      </figure>
      <div>
        {scene.size !== null && <SizeText size={scene.size} />}
        {reimport !== null && <ImportOptionsForm options={reimport.options} onChange={reimport.change} />}
        <p class="quiet" role="status">
          {reimport?.isBusy === true
            ? "Importing again with these options…"
            : used === ""
              ? "Imported as the file says."
              : `Imported with ${used}.`}
        </p>
        {reimport !== null && reimport.problem !== "" && (
          <p class="wrong" role="alert">
            Options unchanged: {reimport.problem}
          </p>
        )}
      </div>
    </div>
  );
}
