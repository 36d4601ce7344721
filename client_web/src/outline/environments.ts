/** The environments that a look may name: the list, choosing one, and importing a file. */
import { computed, signal } from "@preact/signals";
import { edit } from "../edit/edit";
import { isEnvironment } from "../files/files";
import { deleteEnvironment, listEnvironments } from "../net/api";
import { uploadEnvironment } from "../net/upload";
import type { EnvironmentBody } from "../protocol";
import { look } from "../state/look";
import { attempt, note, showError } from "../ui/toasts";

export const environments = signal<EnvironmentBody[]>([]);
/** What is being imported, in words. */
export const importing = signal<string | null>(null);

export async function loadEnvironments(): Promise<void> {
  await attempt(async () => {
    environments.value = await listEnvironments();
  });
}

/** Light the scene by an environment, null for its own. */
export function choose(map: string | null): void {
  const name = environments.value.find((entry) => entry.map === map)?.name ?? "the scene's own";
  edit(`Environment · ${name}`, "/environment/map", map);
}

/** The environment that lights the scene, where it is one that was imported. */
export const imported = computed(
  () => environments.value.find(({ map, created }) => created !== null && map === look.value?.environment.map) ?? null,
);

/** Delete an imported environment once that was confirmed; the scene has its own light again. */
export function offerToDelete({ id, name }: EnvironmentBody): void {
  note(`Delete the environment “${name}”? Looks that name it cannot be shown any more, and this cannot be undone.`, {
    label: "Delete",
    run: () =>
      void attempt(async () => {
        choose(null);
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
export async function take(files: readonly File[]): Promise<void> {
  const file = environmentOf(files);
  if (file === null) {
    showError(`${files.map((each) => each.name).join(", ")}: an environment is one of .hdr .exr.`, "files");
    return;
  }
  if (importing.value !== null) {
    note("One environment is being imported already; drop the next one when it is there.");
    return;
  }
  const tell = (share: number) =>
    (importing.value = share < 1 ? `Sending ${file.name}, ${Math.round(100 * share)} %` : `Reading ${file.name}…`);
  tell(0);
  const body = await attempt(() => uploadEnvironment(file, tell), "files");
  importing.value = null;
  if (body === undefined) return;
  await loadEnvironments();
  choose(body.map);
  for (const warning of body.warnings) note(warning);
}
