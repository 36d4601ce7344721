/** Import: drop files and folders anywhere on the page, or choose them; then the uploads with their progress. */
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
import type { SceneBody } from "../protocol";
import { clearErrors, showError } from "../ui/toasts";
import { ChosenFiles } from "./ChosenFiles";
import { useFileDrop } from "./useFileDrop";
import { useImport, type UploadState } from "./useImport";

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

function FileInput({ label, folder, onFiles }: { label: string; folder?: boolean; onFiles(files: DroppedFile[]): void }) {
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
          event.currentTarget.value = ""; // so that the same file can be chosen again
        }}
      />
    </label>
  );
}

function UploadStatus({ name, fraction, number, count }: UploadState) {
  const which = count > 1 ? ` (${number} of ${count})` : "";
  return (
    <>
      <progress max={1} value={fraction} aria-label="Upload" />
      <span>{fraction < 1 ? `Sending “${name}”${which}, ${Math.round(100 * fraction)} %` : `The server reads “${name}”${which}…`}</span>
    </>
  );
}

export function DropZone({ onImported }: { onImported(scenes: SceneBody[]): void }) {
  const [files, setFiles] = useState<readonly DroppedFile[]>([]);
  const [withGround, setWithGround] = useState(false);
  const { upload, problems, clearProblems, send } = useImport();
  const selection = useSortedFiles(files);
  const { scenes, environment } = selection;
  const addFiles = (files: DroppedFile[]) => {
    if (files.length === 0) return showError("The folder is empty. Nothing was chosen.", "files");
    clearErrors("files"); // what was wrong with those before
    const message = startPageRejection(files);
    if (message !== null) showError(message, "files");
    clearProblems();
    setFiles((current) => mergeFiles(current, files.filter(isImportable)));
  };
  const clear = () => {
    clearErrors("files");
    clearProblems();
    setFiles([]);
  };
  const isDropTarget = useFileDrop(addFiles);
  /** What was refused stays chosen, so that what it lacks can be added. */
  const sendAll = async () => {
    const { imported, done } = await send(selection, withGround);
    setFiles((current) => (done.size === scenes.length ? [] : current.filter(({ path }) => !done.has(path))));
    if (imported.length > 0) onImported(imported);
  };
  return (
    <section class={`drop ${isDropTarget ? "over" : ""}`} aria-label="Import a scene">
      <p>
        <b>Drop a scene, its folder, or an environment anywhere</b>, or <FileInput label="choose files" onFiles={addFiles} />, or{" "}
        <FileInput label="choose a folder" folder onFiles={addFiles} />.
      </p>
      <p class="quiet">
        Scene: .glb, .gltf, .obj, .ply with the files that belong to it, or a .zip of them. Environment: .hdr or .exr;
        without one the scene is lit by a studio.
      </p>
      <ChosenFiles
        scenes={scenes}
        numParts={files.filter(({ file }) => !isEnvironment(file)).length}
        problems={problems}
        onLeaveOut={(path) => setFiles((before) => before.filter((each) => each.path !== path))}
      />
      <div class="chosen">
        <span class={environment ? "" : "quiet"}>Environment: {environment?.name ?? "none"}</span>
        <label class="on-ground">
          <input type="checkbox" checked={withGround} onChange={(event) => setWithGround(event.currentTarget.checked)} />
          Put it on a ground
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
          Add the scene that it shall light. A scene that is here already takes it in the editor, under <i>Environment</i>.
        </p>
      )}
    </section>
  );
}
