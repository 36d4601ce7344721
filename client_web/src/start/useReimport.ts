/** Imports a scene again with other options, as long as the browser has its files. */
import { useRef, useState } from "preact/hooks";
import { LatestRequest } from "../session/net/latestRequest";
import { uploadScene, type SceneUpload } from "../session/net/upload";
import type { ImportOptions, SceneBody } from "../protocol";
import { areSameOptions } from "./importOptions";

export interface Reimport {
  /** The chosen options; those of the shown scene unless an import runs. */
  options: ImportOptions;
  isBusy: boolean;
  /** Why the last change was not possible; empty if it was. */
  problem: string;
  change: (options: ImportOptions) => void;
}

/** `onReplaced` receives the scene of each finished import, and the id of the one before. */
export function useReimport(
  scene: SceneBody,
  upload: SceneUpload | null,
  onReplaced: (scene: SceneBody, replaced: string) => void,
): Reimport {
  const [pending, setPending] = useState<ImportOptions | null>(null);
  const [problem, setProblem] = useState("");
  const shown = useRef(scene.id);
  const requests = useRef<LatestRequest<SceneUpload, SceneBody> | null>(null);
  requests.current ??= new LatestRequest(
    (changed: SceneUpload) => uploadScene(changed, () => undefined),
    (imported) => {
      onReplaced(imported, shown.current);
      shown.current = imported.id;
      setPending((newest) => (newest !== null && areSameOptions(newest, imported.import_options) ? null : newest));
    },
    (error) => {
      setPending(null);
      setProblem(error instanceof Error ? error.message : String(error));
    },
  );
  const change = (options: ImportOptions) => {
    if (upload === null) return;
    setPending(options);
    setProblem("");
    requests.current?.send({ ...upload, options });
  };
  return { options: pending ?? scene.import_options, isBusy: pending !== null, problem, change };
}

/** Scenes of earlier imports; null if they are not known. */
export type KnownScenes = ReadonlySet<string> | null;

/** True if a scene may be deleted once another import option has replaced it: nobody else can miss it. */
export function isDisposable({ id, bakes, views }: SceneBody, known: KnownScenes): boolean {
  return known !== null && !known.has(id) && bakes.length === 0 && !views.some(({ is_placed }) => is_placed);
}
