/** Which of the dropped files are scenes, which belong to one, and which is the environment. */
import type { Dropped } from "./dropped";
import { namedBy } from "./named";

/** As the server reads them. */
export const SCENE_SUFFIXES = [".glb", ".gltf", ".obj", ".ply", ".zip"];
export const ENVIRONMENT_SUFFIXES = [".hdr", ".exr"];
const IMAGE_SUFFIXES = [".png", ".jpg", ".jpeg", ".webp", ".tga", ".bmp", ".tif", ".tiff", ".gif"];
/** What may belong to a scene. */
export const COMPANION_SUFFIXES = [".bin", ".mtl", ...IMAGE_SUFFIXES];

/** Measured materials, which the library takes; a .zip may be one, too. */
export const MEASURED_SUFFIXES = [".binary", ".btf"];

export interface ScenePart extends Dropped {
  /** The files that it names. */
  companions: Dropped[];
  /** Names in it that no file here goes by. */
  missing: string[];
}

export interface Chosen {
  scenes: ScenePart[];
  environment: File | null;
}

export function endsWith(name: string, suffixes: readonly string[]): boolean {
  return suffixes.some((suffix) => name.toLowerCase().endsWith(suffix));
}

export function isEnvironment(file: File): boolean {
  return endsWith(file.name, ENVIRONMENT_SUFFIXES);
}

export const isMeasured = ({ name }: File): boolean => endsWith(name, MEASURED_SUFFIXES);
/** Whether a file is an image, if not always of a kind that a material can show. */
export const isTextureLike = ({ name }: File): boolean => endsWith(name, IMAGE_SUFFIXES);

export const isScene = ({ path }: Dropped) => endsWith(path, SCENE_SUFFIXES);

/** A file's name without its folders and what it ends with. */
export function stem(name: string): string {
  return name.replace(/^.*\//, "").replace(/\.[^.]+$/, "");
}

/** Files that were chosen with a button; those of a folder know where they lay in it. */
export function chosenFiles(files: Iterable<File>): Dropped[] {
  return [...files].map((file) => ({ path: file.webkitRelativePath || file.name, file }));
}

/** Whether the import has a use for a file. */
export function isOfUse({ path }: Dropped): boolean {
  return endsWith(path, [...SCENE_SUFFIXES, ...ENVIRONMENT_SUFFIXES, ...COMPANION_SUFFIXES]);
}

/** What was there and what came; of two files of one name the new one. */
export function together(before: readonly Dropped[], news: readonly Dropped[]): Dropped[] {
  return [...new Map([...before, ...news].map((each) => [each.path, each])).values()];
}

export async function sortFiles(files: readonly Dropped[]): Promise<Chosen> {
  const environments = files.filter(({ file }) => isEnvironment(file));
  const byPath = new Map(files.map((each) => [each.path.toLowerCase(), each]));
  const find = (path: string) => byPath.get(path.toLowerCase());
  const images = files.filter(({ path }) => endsWith(path, IMAGE_SUFFIXES));
  const scenes = await Promise.all(
    files.filter(isScene).map(async (scene) => ({ ...scene, ...(await namedBy(scene, find, images)) })),
  );
  scenes.sort((a, b) => a.path.localeCompare(b.path, undefined, { numeric: true }));
  return { scenes, environment: environments.at(-1)?.file ?? null };
}
