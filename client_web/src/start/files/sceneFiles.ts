/** Which of the dropped files are scenes, which belong to one, and which is the environment. */
import type { DroppedFile } from "./dropTypes";
import { findReferences } from "./references";

/** As the server reads them. */
export const SCENE_SUFFIXES = [".glb", ".gltf", ".obj", ".ply", ".zip"];
export const ENVIRONMENT_SUFFIXES = [".hdr", ".exr"];
const IMAGE_SUFFIXES = [".png", ".jpg", ".jpeg", ".webp", ".tga", ".bmp", ".tif", ".tiff", ".gif"];
/** What may belong to a scene. */
export const COMPANION_SUFFIXES = [".bin", ".mtl", ...IMAGE_SUFFIXES];

/** Measured materials, which the library takes; a .zip may be one, too. */
export const MEASURED_SUFFIXES = [".binary", ".btf"];

export interface SceneFile extends DroppedFile {
  /** The files that it names. */
  companions: DroppedFile[];
  /** Names in it that no file here goes by. */
  missing: string[];
}

export interface ImportSelection {
  scenes: SceneFile[];
  environment: File | null;
}

export function endsWith(name: string, suffixes: readonly string[]): boolean {
  return suffixes.some((suffix) => name.toLowerCase().endsWith(suffix));
}

export function isEnvironment(file: File): boolean {
  return endsWith(file.name, ENVIRONMENT_SUFFIXES);
}

export const isMeasuredFile = ({ name }: File): boolean => endsWith(name, MEASURED_SUFFIXES);
/** Whether a file is an image, if not always of a kind that a material can show. */
export const isTextureLike = ({ name }: File): boolean => endsWith(name, IMAGE_SUFFIXES);

export const isSceneFile = ({ path }: DroppedFile) => endsWith(path, SCENE_SUFFIXES);

/** A file's name without its folders and what it ends with. */
export function fileBaseName(name: string): string {
  return name.replace(/^.*\//, "").replace(/\.[^.]+$/, "");
}

/** Files that were chosen with a button; those of a folder know where they lay in it. */
export function listSelectedFiles(files: Iterable<File>): DroppedFile[] {
  return [...files].map((file) => ({ path: file.webkitRelativePath || file.name, file }));
}

/** Whether the import has a use for a file. */
export function isImportable({ path }: DroppedFile): boolean {
  return endsWith(path, [...SCENE_SUFFIXES, ...ENVIRONMENT_SUFFIXES, ...COMPANION_SUFFIXES]);
}

/** What was there and what came; of two files of one name the new one. */
export function mergeFiles(current: readonly DroppedFile[], added: readonly DroppedFile[]): DroppedFile[] {
  return [...new Map([...current, ...added].map((each) => [each.path, each])).values()];
}

export async function sortFiles(files: readonly DroppedFile[]): Promise<ImportSelection> {
  const environments = files.filter(({ file }) => isEnvironment(file));
  const byPath = new Map(files.map((each) => [each.path.toLowerCase(), each]));
  const findFile = (path: string) => byPath.get(path.toLowerCase());
  const images = files.filter(({ path }) => endsWith(path, IMAGE_SUFFIXES));
  const scenes = await Promise.all(
    files.filter(isSceneFile).map(async (scene) => ({ ...scene, ...(await findReferences(scene, findFile, images)) })),
  );
  scenes.sort((a, b) => a.path.localeCompare(b.path, undefined, { numeric: true }));
  return { scenes, environment: environments.at(-1)?.file ?? null };
}
