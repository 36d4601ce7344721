/** Imports the chosen scenes. */
import { useState } from "preact/hooks";
import { fileBaseName, type ImportSelection } from "./files/sceneFiles";
import { uploadScene } from "../session/net/upload";
import type { SceneBody } from "../protocol";
import { clearErrors, showError } from "../ui/toasts";

export interface UploadState {
  name: string;
  /** Uploaded fraction. */
  fraction: number;
  /** Number of the scene, from 1, and their count. */
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
  /** Import errors by path. */
  problems: ReadonlyMap<string, string>;
  clearProblems: () => void;
  /** Import scenes sequentially; show errors. */
  send: (selection: ImportSelection, ground: boolean) => Promise<ImportOutcome>;
}

function showRejected(problems: ReadonlyMap<string, string>, numSent: number): void {
  if (problems.size === 0) return;
  showError(
    numSent === 1
      ? [...problems].map(([path, problem]) => `${path}: ${problem}`).join()
      : `${numSent - problems.size} ${numSent - problems.size === 1 ? "scene" : "scenes"} imported, ${problems.size} failed. See the list above.`,
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
