/** Import: drop files and folders anywhere on the page, or choose them; then upload progress. */
import { useEffect, useState } from "preact/hooks";
import type { DroppedFile } from "./files/dropTypes";
import {
  listSelectedFiles,
  COMPANION_SUFFIXES,
  ENVIRONMENT_SUFFIXES,
  isEnvironment,
  isImportable,
  SCENE_SUFFIXES,
  sortFiles,
  mergeFiles,
  type ImportSelection,
} from "./files/sceneFiles";
import { startPageRejection } from "./files/rejections";
import { clearErrors, showError } from "../ui/toasts";
import { ChosenFiles } from "./ChosenFiles";
import { ImportOptionsForm } from "./ImportOptionsForm";
import { DEFAULT_OPTIONS } from "./importOptions";
import { useFileDrop } from "./useFileDrop";
import { useImport, type ImportedScene, type UploadState } from "./useImport";

const EMPTY_SELECTION: ImportSelection = { scenes: [], environment: null };

function useSortedFiles(files: readonly DroppedFile[]): ImportSelection {
  const [selection, setSelection] = useState(EMPTY_SELECTION);
  useEffect(() => {
    let stale = false;
    void sortFiles(files).then((sorted) => !stale && setSelection(sorted));
    return () => {
      stale = true;
    };
  }, [files]);
  return selection;
}

function FileInput({
  label,
  folder,
  onFiles,
}: {
  label: string;
  folder?: boolean;
  onFiles: (files: DroppedFile[]) => void;
}) {
  const accept = [...SCENE_SUFFIXES, ...ENVIRONMENT_SUFFIXES, ...COMPANION_SUFFIXES].join(",");
  return (
    <label class="file">
      {label}
      <input
        type="file"
        multiple
        {...(folder ? { webkitdirectory: true } : { accept })}
        onChange={(event) => {
          onFiles(listSelectedFiles(event.currentTarget.files ?? []));
          event.currentTarget.value = ""; // allows choosing the same file again
        }}
      />
    </label>
  );
}

function UploadStatus({ name, fraction, number, count }: UploadState) {
  const countText = count > 1 ? ` (${number} of ${count})` : "";
  return (
    <>
      <progress max={1} value={fraction} aria-label="Upload" />
      <span>
        {fraction < 1
          ? `Uploading “${name}”${countText}, ${Math.round(100 * fraction)} %`
          : `Importing “${name}”${countText}…`}
      </span>
    </>
  );
}

export function DropZone({ onImported }: { onImported: (scenes: ImportedScene[]) => void }) {
  const [files, setFiles] = useState<readonly DroppedFile[]>([]);
  const [withGround, setWithGround] = useState(false);
  const [options, setOptions] = useState(DEFAULT_OPTIONS);
  const { upload, problems, clearProblems, send } = useImport();
  const selection = useSortedFiles(files);
  const { scenes, environment } = selection;
  const addFiles = (added: DroppedFile[]) => {
    if (added.length === 0) return showError("This folder is empty.", "files");
    clearErrors("files"); // of earlier drops
    const message = startPageRejection(added, files);
    if (message !== null) showError(message, "files");
    clearProblems();
    setFiles((current) => mergeFiles(current, added.filter(isImportable)));
  };
  const clear = () => {
    clearErrors("files");
    clearProblems();
    setFiles([]);
    setOptions(DEFAULT_OPTIONS);
  };
  const isDropTarget = useFileDrop(addFiles);
  /** Rejected scenes stay chosen, so that missing files can be added. */
  const sendAll = async () => {
    const { imported, done } = await send(selection, withGround, options);
    setFiles((current) => (done.size === scenes.length ? [] : current.filter(({ path }) => !done.has(path))));
    if (done.size === scenes.length) setOptions(DEFAULT_OPTIONS);
    if (imported.length > 0) onImported(imported);
  };
  return (
    <section class={`drop ${isDropTarget ? "over" : ""}`} aria-label="Import a scene">
      <p>
        <b>Drop a scene file, a folder or an HDRI anywhere</b>, or <FileInput label="choose files" onFiles={addFiles} />
        , or <FileInput label="choose a folder" folder onFiles={addFiles} />.
      </p>
      <p class="quiet">
        Scenes: GLB, glTF, OBJ, PLY, STL, USD or ZIP. HDRI: HDR or EXR. Without one, studio lighting is used.
      </p>
      <ChosenFiles
        scenes={scenes}
        numParts={files.filter(({ file }) => !isEnvironment(file)).length}
        problems={problems}
        onLeaveOut={(path) => setFiles((before) => before.filter((each) => each.path !== path))}
      />
      {scenes.length > 0 && <ImportOptionsForm options={options} onChange={setOptions} />}
      <div class="chosen">
        <span class={environment ? "" : "quiet"}>
          {environment === null ? "Default studio lighting" : `HDRI: ${environment.name}`}
        </span>
        <label class="on-ground">
          <input
            type="checkbox"
            checked={withGround}
            onChange={(event) => setWithGround(event.currentTarget.checked)}
          />
          Add a ground plane (shadow catcher)
        </label>
        {upload !== null ? (
          <UploadStatus {...upload} />
        ) : (
          <>
            <button class="primary" disabled={scenes.length === 0} onClick={() => void sendAll()}>
              {scenes.length > 1 ? `Import ${scenes.length} scenes` : "Import"}
            </button>
            {files.length > 0 && <button onClick={clear}>Clear</button>}
          </>
        )}
      </div>
      {environment !== null && scenes.length === 0 && (
        <p class="quiet" role="status">
          Add a scene to light with it, or open an existing scene and drop it there.
        </p>
      )}
    </section>
  );
}
