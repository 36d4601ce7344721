/** The environments that a look may name: the list, choosing one, and importing a file. */
import { computed, signal } from "@preact/signals";
import { editValue } from "../../edit/edit";
import { isEnvironment } from "../../start/files/sceneFiles";
import { deleteEnvironment, listEnvironments } from "../../session/net/api";
import { uploadEnvironment } from "../../session/net/upload";
import type { EnvironmentBody } from "../../protocol";
import { look } from "../../state/look";
import { reportErrors, showNote, showError } from "../../ui/toasts";

export const environments = signal<EnvironmentBody[]>([]);
/** Progress text of the import. */
export const importProgress = signal<string | null>(null);

export async function loadEnvironments(): Promise<void> {
  await reportErrors(async () => {
    environments.value = await listEnvironments();
  });
}

/** Light the scene by an environment, null for its own. */
export function chooseEnvironment(map: string | null): void {
  const name = environments.value.find((entry) => entry.map === map)?.name ?? "the scene's own";
  editValue(`Environment · ${name}`, "/environment/map", map);
}

/** The environment that lights the scene, where it is one that was imported. */
export const imported = computed(
  () => environments.value.find(({ map, created }) => created !== null && map === look.value?.environment.map) ?? null,
);

/** Delete an imported environment once that was confirmed; the scene has its own light again. */
export function offerToDeleteEnvironment({ id, name }: EnvironmentBody): void {
  showNote(`Delete the environment “${name}”? Looks that name it cannot be shown any more, and this cannot be undone.`, {
    label: "Delete",
    run: () =>
      void reportErrors(async () => {
        chooseEnvironment(null);
        await deleteEnvironment(id);
        await loadEnvironments();
      }),
  });
}

/** Of dropped or chosen files, the first that is an environment. */
export function environmentOf(files: readonly File[]): File | null {
  return files.find(isEnvironment) ?? null;
}

/** Import the environment among some files, and light the scene by it. */
export async function importEnvironmentFile(files: readonly File[]): Promise<void> {
  const file = environmentOf(files);
  if (file === null) {
    showError(`${files.map((file) => file.name).join(", ")}: an environment is one of .hdr .exr.`, "files");
    return;
  }
  if (importProgress.value !== null) {
    showNote("One environment is being imported already; drop the next one when it is there.");
    return;
  }
  const onProgress = (fraction: number) =>
    (importProgress.value = fraction < 1 ? `Sending ${file.name}, ${Math.round(100 * fraction)} %` : `Reading ${file.name}…`);
  onProgress(0);
  const body = await reportErrors(() => uploadEnvironment(file, onProgress), "files");
  importProgress.value = null;
  if (body === undefined) return;
  await loadEnvironments();
  chooseEnvironment(body.map);
  for (const warning of body.warnings) showNote(warning);
}
