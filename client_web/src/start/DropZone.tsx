/** Import: drop files and folders anywhere on the page, or choose them; then the uploads with their progress. */
import { useEffect, useState } from "preact/hooks";
import type { Dropped } from "../files/dropped";
import {
  chosenFiles,
  COMPANION_SUFFIXES,
  ENVIRONMENT_SUFFIXES,
  isEnvironment,
  isOfUse,
  SCENE_SUFFIXES,
  sortFiles,
  together,
  type Chosen,
} from "../files/files";
import { refusalOnStart } from "../files/refusals";
import type { SceneBody } from "../protocol";
import { mended, showError } from "../ui/toasts";
import { ChosenScenes } from "./ChosenScenes";
import { useFileDrop } from "./useFileDrop";
import { useImport, type Sending } from "./useImport";

const NOTHING: Chosen = { scenes: [], environment: null };

function useSorted(files: readonly Dropped[]): Chosen {
  const [chosen, setChosen] = useState(NOTHING);
  useEffect(() => {
    let stale = false;
    void sortFiles(files).then((sorted) => !stale && setChosen(sorted));
    return () => {
      stale = true;
    };
  }, [files]);
  return chosen;
}

function FileInput({ label, folder, take }: { label: string; folder?: boolean; take(files: Dropped[]): void }) {
  const accept = [...SCENE_SUFFIXES, ...ENVIRONMENT_SUFFIXES, ...COMPANION_SUFFIXES].join(",");
  return (
    <label class="file">
      {label}
      <input
        type="file"
        multiple
        {...(folder ? { webkitdirectory: true } : { accept })}
        onChange={(event) => {
          take(chosenFiles(event.currentTarget.files ?? []));
          event.currentTarget.value = ""; // so that the same file can be chosen again
        }}
      />
    </label>
  );
}

function SendingWords({ name, share, number, count }: Sending) {
  const which = count > 1 ? ` (${number} of ${count})` : "";
  return (
    <>
      <progress max={1} value={share} aria-label="Upload" />
      <span>{share < 1 ? `Sending “${name}”${which}, ${Math.round(100 * share)} %` : `The server reads “${name}”${which}…`}</span>
    </>
  );
}

export function DropZone({ onImported }: { onImported(scenes: SceneBody[]): void }) {
  const [files, setFiles] = useState<readonly Dropped[]>([]);
  const [ground, setGround] = useState(false);
  const { sending, problems, forgetProblems, send } = useImport();
  const chosen = useSorted(files);
  const { scenes, environment } = chosen;
  const take = (news: Dropped[]) => {
    if (news.length === 0) return showError("The folder is empty. Nothing was chosen.", "files");
    mended("files"); // what was wrong with those before
    const words = refusalOnStart(news);
    if (words !== null) showError(words, "files");
    forgetProblems();
    setFiles((before) => together(before, news.filter(isOfUse)));
  };
  const clear = () => {
    mended("files");
    forgetProblems();
    setFiles([]);
  };
  const over = useFileDrop(take);
  /** What was refused stays chosen, so that what it lacks can be added. */
  const sendAll = async () => {
    const { imported, done } = await send(chosen, ground);
    setFiles((before) => (done.size === scenes.length ? [] : before.filter(({ path }) => !done.has(path))));
    if (imported.length > 0) onImported(imported);
  };
  return (
    <section class={`drop ${over ? "over" : ""}`} aria-label="Import a scene">
      <p>
        <b>Drop a scene, its folder, or an environment anywhere</b>, or <FileInput label="choose files" take={take} />, or{" "}
        <FileInput label="choose a folder" folder take={take} />.
      </p>
      <p class="quiet">
        Scene: .glb, .gltf, .obj, .ply with the files that belong to it, or a .zip of them. Environment: .hdr or .exr;
        without one the scene is lit by a studio.
      </p>
      <ChosenScenes
        scenes={scenes}
        numParts={files.filter(({ file }) => !isEnvironment(file)).length}
        problems={problems}
        onLeaveOut={(path) => setFiles((before) => before.filter((each) => each.path !== path))}
      />
      <div class="chosen">
        <span class={environment ? "" : "quiet"}>Environment: {environment?.name ?? "none"}</span>
        <label class="on-ground">
          <input type="checkbox" checked={ground} onChange={(event) => setGround(event.currentTarget.checked)} />
          Put it on a ground
        </label>
        {sending !== null ? (
          <SendingWords {...sending} />
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
