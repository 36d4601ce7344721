/** Sorts dropped files into scenes, their companion files, and the environment. */
import type { DroppedFile } from "./dropTypes";
import { findReferences } from "./references";

const LAYER_SUFFIXES = [".usd", ".usda", ".usdc"];
/** Scene formats of the server. */
export const SCENE_SUFFIXES = [".glb", ".gltf", ".obj", ".ply", ".stl", ...LAYER_SUFFIXES, ".usdz", ".zip"];
export const ENVIRONMENT_SUFFIXES = [".hdr", ".exr"];
export const IMAGE_SUFFIXES = [".png", ".jpg", ".jpeg", ".webp", ".tga", ".bmp", ".dds", ".tif", ".tiff", ".gif"];
/** Materials for the library, and layers of USD; a .zip may be one, too. */
export const MATERIALX_SUFFIX = ".mtlx";
/** Suffixes of companion files. */
export const COMPANION_SUFFIXES = [".bin", ".mtl", MATERIALX_SUFFIX, ...IMAGE_SUFFIXES];
/** Files that a USD layer may name, beside images and other layers. */
const STAGE_SUFFIXES = [...LAYER_SUFFIXES, ".usdz", MATERIALX_SUFFIX, ...IMAGE_SUFFIXES, ...ENVIRONMENT_SUFFIXES];
/** Longer layers are not searched for names. */
const MAX_LAYER_BYTES = 16 << 20;
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

export const isLayer = ({ path }: DroppedFile) => endsWith(path, LAYER_SUFFIXES);
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

/** True for maps that belong to a USD stage: its layers name them, or they lie in a folder that was dropped with it. */
async function findStageMaps(files: readonly DroppedFile[]): Promise<(file: DroppedFile) => boolean> {
  const layers = files.filter(isLayer);
  const texts = await Promise.all(layers.map(({ file }) => file.slice(0, MAX_LAYER_BYTES).text()));
  return ({ path, file }) =>
    layers.length > 0 && (path.includes("/") || texts.some((text) => text.includes(file.name)));
}

export async function sortFiles(files: readonly DroppedFile[]): Promise<ImportSelection> {
  const isStageMap = await findStageMaps(files);
  const environments = files.filter((each) => isEnvironment(each.file) && !isStageMap(each));
  const byPath = new Map(files.map((each) => [each.path.toLowerCase(), each]));
  const findFile = (path: string) => byPath.get(path.toLowerCase());
  const images = files.filter(({ path }) => endsWith(path, IMAGE_SUFFIXES));
  const stageFiles = files.filter(({ path }) => endsWith(path, STAGE_SUFFIXES));
  const read = async (scene: DroppedFile) => {
    // binary layers cannot be searched for all names: all that a stage may consist of is sent
    if (isLayer(scene)) return { ...scene, companions: stageFiles.filter((file) => file !== scene), missing: [] };
    return { ...scene, ...(await findReferences(scene, findFile, images)) };
  };
  const scenes = await Promise.all(files.filter(isSceneFile).map(read));
  scenes.sort((a, b) => a.path.localeCompare(b.path, undefined, { numeric: true }));
  return { scenes, environment: environments.at(-1)?.file ?? null };
}
