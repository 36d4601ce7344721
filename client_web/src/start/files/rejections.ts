/** Rejected files: why, and where they belong. */
import type { DroppedFile } from "./dropTypes";
import { endsWith, ENVIRONMENT_SUFFIXES, isImportable, isSceneFile, MEASURED_SUFFIXES, SCENE_SUFFIXES } from "./sceneFiles";

/** Measurements in formats that nothing here reads. */
const OTHER_MEASURED_SUFFIXES = [".brdf", ".bsdf", ".merl", ".mbdf"];
const UNSUPPORTED_SCENE_SUFFIXES = [".fbx", ".blend", ".usd", ".usda", ".usdc", ".usdz", ".dae", ".stl", ".3ds", ".max", ".abc"];

const MAX_LISTED_FILES = 5;

/** The names of some files, the first few. */
function listFileNames(files: readonly DroppedFile[]): string {
  const more = files.length > MAX_LISTED_FILES ? ` and ${files.length - MAX_LISTED_FILES} more` : "";
  return files.slice(0, MAX_LISTED_FILES).map(({ path }) => path).join(", ") + more;
}

const MEASURED_MESSAGE = "Measured materials go into the Library of an open scene, as MERL (.binary) or BTF (.btf, .zip).";
const SCENES_MESSAGE = `A scene is one of ${SCENE_SUFFIXES.join(" ")}.`;

/** Where files belong that nothing here takes, by the kind of the first. */
function rejectionReason([first]: readonly DroppedFile[], fallback: string): string {
  const name = first?.path ?? "";
  if (endsWith(name, [...MEASURED_SUFFIXES, ...OTHER_MEASURED_SUFFIXES])) return MEASURED_MESSAGE;
  if (endsWith(name, UNSUPPORTED_SCENE_SUFFIXES)) return `${SCENES_MESSAGE} Export it as .glb, and drop that on the start page.`;
  return fallback;
}

/** Why the editor takes none of these files. */
export function editorRejection(files: readonly DroppedFile[]): string {
  const isForStart = files.some(isSceneFile);
  const otherwise = isForStart
    ? "Scenes are imported on the start page; a BTF in a .zip goes into the Library."
    : "The editor takes images (.png, .jpg, .webp), environments (.hdr, .exr) and measured materials (.binary, .btf).";
  return `${listFileNames(files)}: ${rejectionReason(files, otherwise)}`;
}

/** Why the start page can import nothing of a drop, or not all of it; null where it can. A folder may hold anything. */
export function startPageRejection(files: readonly DroppedFile[]): string | null {
  const formats = `${SCENES_MESSAGE} An environment is one of ${ENVIRONMENT_SUFFIXES.join(" ")}.`;
  const rejected = files.filter((each) => !isImportable(each) && !each.path.includes("/"));
  if (rejected.length > 0) return `${listFileNames(rejected)}: ${rejectionReason(rejected, formats)}`;
  return files.some(isImportable) ? null : `There is nothing to import in it. ${formats}`;
}
