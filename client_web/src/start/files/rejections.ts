/** Messages about rejected files: the reason, and where they can be used. */
import type { DroppedFile } from "./dropTypes";
import { endsWith, isImportable, isLayer, isSceneFile, MATERIALX_SUFFIX, MEASURED_SUFFIXES } from "./sceneFiles";

/** Unsupported formats of measured materials. */
const OTHER_MEASURED_SUFFIXES = [".merl", ".mbdf"];
export const UNSUPPORTED_SCENE_SUFFIXES = [".fbx", ".blend", ".dae", ".3ds", ".max", ".abc"];

const MAX_LISTED_FILES = 5;

/** The first few file names. */
function listFileNames(files: readonly DroppedFile[]): string {
  const more = files.length > MAX_LISTED_FILES ? ` and ${files.length - MAX_LISTED_FILES} more` : "";
  return (
    files
      .slice(0, MAX_LISTED_FILES)
      .map(({ path }) => path)
      .join(", ") + more
  );
}

const MEASURED_MESSAGE =
  "Open a scene and drop materials on the Library: MaterialX (.mtlx, .zip), MERL (.binary), RGL (.bsdf), Cornell (.brdf) or BTF (.btf, .zip).";
const SCENES_MESSAGE = "Scenes: GLB, glTF, OBJ, PLY, STL, USD or ZIP.";

/** Advice for rejected files, by the type of the first. */
function rejectionReason([first]: readonly DroppedFile[], fallback: string): string {
  const name = first?.path ?? "";
  if (endsWith(name, [...MEASURED_SUFFIXES, ...OTHER_MEASURED_SUFFIXES])) return MEASURED_MESSAGE;
  if (endsWith(name, UNSUPPORTED_SCENE_SUFFIXES))
    return `${SCENES_MESSAGE} Export a GLB and drop it on the start page.`;
  return fallback;
}

/** Message about files that the editor cannot use. */
export function editorRejection(files: readonly DroppedFile[]): string {
  const isForStart = files.some(isSceneFile);
  const otherwise = isForStart
    ? "Import scenes on the start page. For a BTF in a ZIP, drop it on the Library."
    : "HDRIs: HDR or EXR. Textures: PNG, JPG or WebP. One LUT: CUBE. One look or light mix: JSON. Measured materials: drop them on the Library.";
  return `Can't use ${listFileNames(files)} here. ${rejectionReason(files, otherwise)}`;
}

/**
 * Message if the start page cannot import some dropped files; null if it can. A folder may contain unrelated files, and
 * MaterialX documents belong to a USD layer, here or among the files chosen before.
 */
export function startPageRejection(files: readonly DroppedFile[], chosen: readonly DroppedFile[] = []): string | null {
  const formats = `${SCENES_MESSAGE} HDRIs: HDR or EXR.`;
  const hasLayer = [...chosen, ...files].some(isLayer);
  const isUsable = (each: DroppedFile) => isImportable(each) && (hasLayer || !endsWith(each.path, [MATERIALX_SUFFIX]));
  const rejected = files.filter((each) => !isUsable(each) && !each.path.includes("/"));
  if (rejected.length > 0) return `Can't open ${listFileNames(rejected)}. ${rejectionReason(rejected, formats)}`;
  return files.some(isUsable) ? null : `Nothing to import in this folder. ${formats}`;
}
