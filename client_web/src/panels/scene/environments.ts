/** The environments of the server: listing, choosing, importing and deleting them. */
import { computed, signal } from "@preact/signals";
import { editValue } from "../../edit/edit";
import { isEnvironment } from "../../start/files/sceneFiles";
import { deleteEnvironment, listEnvironments } from "../../session/net/api";
import { uploadEnvironment } from "../../session/net/upload";
import type { EnvironmentBody } from "../../protocol";
import { look } from "../../state/look";
import { reportErrors, showNote, showWarnings, showError } from "../../ui/toasts";

export const environments = signal<EnvironmentBody[]>([]);
/** Progress text of the import. */
export const importProgress = signal<string | null>(null);

export async function loadEnvironments(): Promise<void> {
  await reportErrors(async () => {
    environments.value = await listEnvironments();
  });
}

/** Light the scene with an environment; null: the original one. */
export function chooseEnvironment(map: string | null): void {
  const name = environments.value.find((entry) => entry.map === map)?.name ?? "original";
  editValue(`Environment · ${name}`, "/environment/map", map);
}

/** The current environment, if it was imported. */
export const imported = computed(
  () => environments.value.find(({ map, created }) => created !== null && map === look.value?.environment.map) ?? null,
);

/** Delete an imported environment after confirmation; the scene gets its original one back. */
export function offerToDeleteEnvironment({ id, name }: EnvironmentBody): void {
  showNote(`Delete the HDRI “${name}”? Saved looks that use it will stop working. This can't be undone.`, {
    label: "Delete",
    run: () =>
      void reportErrors(async () => {
        chooseEnvironment(null);
        await deleteEnvironment(id);
        await loadEnvironments();
      }),
  });
}

/** The first environment among dropped or chosen files. */
export function environmentOf(files: readonly File[]): File | null {
  return files.find(isEnvironment) ?? null;
}

/** Import the environment among some files, and light the scene with it. */
export async function importEnvironmentFile(files: readonly File[]): Promise<void> {
  const file = environmentOf(files);
  if (file === null) {
    showError(`Can't use ${files.map((file) => file.name).join(", ")}. HDRIs: HDR or EXR.`, "files");
    return;
  }
  if (importProgress.value !== null) {
    showNote("Still importing another HDRI; try again in a moment.");
    return;
  }
  const onProgress = (fraction: number) =>
    (importProgress.value =
      fraction < 1 ? `Uploading ${file.name}, ${Math.round(100 * fraction)} %` : `Processing ${file.name}…`);
  onProgress(0);
  const body = await reportErrors(() => uploadEnvironment(file, onProgress), "files");
  importProgress.value = null;
  if (body === undefined) return;
  await loadEnvironments();
  chooseEnvironment(body.map);
  showWarnings(body.warnings);
}
