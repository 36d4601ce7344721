/** Sorts dropped files into scenes, their companion files, and the environment. */
import type { DroppedFile } from "./dropTypes";
import { findReferences } from "./references";

const LAYER_SUFFIXES = [".usd", ".usda", ".usdc"];
/** Scene formats of the server. */
export const SCENE_SUFFIXES = [".glb", ".gltf", ".obj", ".ply", ".stl", ...LAYER_SUFFIXES, ".usdz", ".zip"];
export const ENVIRONMENT_SUFFIXES = [".hdr", ".exr"];
export const IMAGE_SUFFIXES = [".png", ".jpg", ".jpeg", ".webp", ".tga", ".bmp", ".dds", ".tif", ".tiff", ".gif"];
/** Suffixes of companion files. */
export const COMPANION_SUFFIXES = [".bin", ".mtl", ...IMAGE_SUFFIXES];

/** Materials for the library; a .zip may be one, too. */
export const MATERIALX_SUFFIX = ".mtlx";
export const MEASURED_SUFFIXES = [".binary", ".bsdf", ".brdf", ".btf", MATERIALX_SUFFIX];

export interface SceneFile extends DroppedFile {
  /** The files that the scene refers to. */
  companions: DroppedFile[];
  /** References without a matching file. */
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
/** True if a file is an image with display values. */
export const isDisplayImage = ({ name }: File): boolean => endsWith(name, IMAGE_SUFFIXES);

export const isSceneFile = ({ path }: DroppedFile) => endsWith(path, SCENE_SUFFIXES);

/** A file's name without folders and suffix. */
export function fileBaseName(name: string): string {
  return name.replace(/^.*\//, "").replace(/\.[^.]+$/, "");
}

/** Files chosen with a file input; those of a folder have their relative paths. */
export function listSelectedFiles(files: Iterable<File>): DroppedFile[] {
  return [...files].map((file) => ({ path: file.webkitRelativePath || file.name, file }));
}

/** True if the import can use a file. */
export function isImportable({ path }: DroppedFile): boolean {
  return endsWith(path, [...SCENE_SUFFIXES, ...ENVIRONMENT_SUFFIXES, ...COMPANION_SUFFIXES]);
}

/** The previous files and the new ones, which replace files of the same path. */
export function mergeFiles(current: readonly DroppedFile[], added: readonly DroppedFile[]): DroppedFile[] {
  return [...new Map([...current, ...added].map((each) => [each.path, each])).values()];
}

export async function sortFiles(files: readonly DroppedFile[]): Promise<ImportSelection> {
  const environments = files.filter(({ file }) => isEnvironment(file));
  const byPath = new Map(files.map((each) => [each.path.toLowerCase(), each]));
  const findFile = (path: string) => byPath.get(path.toLowerCase());
  const images = files.filter(({ path }) => endsWith(path, IMAGE_SUFFIXES));
  const layers = files.filter(({ path }) => endsWith(path, LAYER_SUFFIXES));
  const read = async (scene: DroppedFile) => ({ ...scene, ...(await findReferences(scene, findFile, images, layers)) });
  const scenes = await Promise.all(files.filter(isSceneFile).map(read));
  scenes.sort((a, b) => a.path.localeCompare(b.path, undefined, { numeric: true }));
  return { scenes, environment: environments.at(-1)?.file ?? null };
}
