/** Imports the chosen scenes. */
import { useState } from "preact/hooks";
import { fileBaseName, type ImportSelection } from "./files/sceneFiles";
import { uploadScene, type SceneUpload } from "../session/net/upload";
import type { ImportOptions, SceneBody } from "../protocol";
import { clearErrors, showError } from "../ui/toasts";

export interface UploadState {
  name: string;
  /** Uploaded fraction. */
  fraction: number;
  /** Number of the scene, from 1, and their count. */
  number: number;
  count: number;
}

/** An imported scene and its files. */
export interface ImportedScene {
  scene: SceneBody;
  upload: SceneUpload;
}

interface ImportOutcome {
  imported: ImportedScene[];
  /** Paths of the scenes that were imported. */
  done: ReadonlySet<string>;
}

interface SceneImport {
  upload: UploadState | null;
  /** Import errors by path. */
  problems: ReadonlyMap<string, string>;
  clearProblems: () => void;
  /** Import scenes sequentially; show errors. */
  send: (selection: ImportSelection, ground: boolean, options: ImportOptions) => Promise<ImportOutcome>;
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
  const send = async ({ scenes, environment }: ImportSelection, ground: boolean, options: ImportOptions) => {
    const imported: ImportedScene[] = [];
    const importedPaths = new Set<string>();
    const rejected = new Map<string, string>();
    clearErrors("files");
    for (const [k, scene] of scenes.entries()) {
      const name = fileBaseName(scene.path);
      try {
        const upload = { scene, companions: scene.companions, environment, name, ground, options };
        const uploadInfo = { name, number: k + 1, count: scenes.length };
        setUpload({ ...uploadInfo, fraction: 0 });
        const showProgress = (fraction: number) => setUpload({ ...uploadInfo, fraction });
        imported.push({ scene: await uploadScene(upload, showProgress), upload });
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
