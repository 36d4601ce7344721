/** Import of the selected scenes. */
import { useState } from "preact/hooks";
import { fileBaseName, type ImportSelection } from "./files/sceneFiles";
import { uploadScene } from "../session/net/upload";
import type { SceneBody } from "../protocol";
import { clearErrors, showError } from "../ui/toasts";

export interface UploadState {
  name: string;
  /** Of the bytes that are sent. */
  fraction: number;
  /** Which one it is, from 1, of how many. */
  number: number;
  count: number;
}

interface ImportOutcome {
  imported: SceneBody[];
  /** Paths of the scenes that were imported. */
  done: ReadonlySet<string>;
}

interface SceneImport {
  upload: UploadState | null;
  /** What was wrong with the scenes that were refused, by their paths. */
  problems: ReadonlyMap<string, string>;
  clearProblems(): void;
  /** Sequential; rejections are shown. */
  send(selection: ImportSelection, ground: boolean): Promise<ImportOutcome>;
}

function showRejected(problems: ReadonlyMap<string, string>, numSent: number): void {
  if (problems.size === 0) return;
  showError(
    numSent === 1
      ? [...problems].map(([path, problem]) => `${path}: ${problem}`).join()
      : `${problems.size} of ${numSent} scenes could not be imported; the list says why.`,
    "files",
  );
}

export function useImport(): SceneImport {
  const [upload, setUpload] = useState<UploadState | null>(null);
  const [problems, setProblems] = useState<ReadonlyMap<string, string>>(new Map());
  const send = async ({ scenes, environment }: ImportSelection, ground: boolean) => {
    const imported: SceneBody[] = [];
    const importedPaths = new Set<string>();
    const rejected = new Map<string, string>();
    clearErrors("files");
    for (const [k, scene] of scenes.entries()) {
      const name = fileBaseName(scene.path);
      try {
        const order = { scene, companions: scene.companions, environment, name, ground };
        const uploadInfo = { name, number: k + 1, count: scenes.length };
        setUpload({ ...uploadInfo, fraction: 0 });
        imported.push(await uploadScene(order, (fraction) => setUpload({ ...uploadInfo, fraction })));
        importedPaths.add(scene.path);
      } catch (error) {
        rejected.set(scene.path, (error as Error).message);
      }
    }
    setUpload(null);
    setProblems(rejected);
    showRejected(rejected, scenes.length);
    return { imported, done: importedPaths };
  };
  return { upload, problems, clearProblems: () => setProblems(new Map()), send };
}
