/** Files that cannot be taken where they were dropped: why, and where they belong. */
import type { Dropped } from "./dropped";
import { endsWith, ENVIRONMENT_SUFFIXES, isOfUse, isScene, MEASURED_SUFFIXES, SCENE_SUFFIXES } from "./files";

/** Measurements in formats that nothing here reads. */
const OTHER_MEASURED_SUFFIXES = [".brdf", ".bsdf", ".merl", ".mbdf"];
const SCENES_OF_OTHERS = [".fbx", ".blend", ".usd", ".usda", ".usdc", ".usdz", ".dae", ".stl", ".3ds", ".max", ".abc"];

const MAX_NAMED = 5;

/** The names of some files, the first few. */
function namesOf(files: readonly Dropped[]): string {
  const more = files.length > MAX_NAMED ? ` and ${files.length - MAX_NAMED} more` : "";
  return files.slice(0, MAX_NAMED).map(({ path }) => path).join(", ") + more;
}

const MEASURED_WORDS = "Measured materials go into the Library of an open scene, as MERL (.binary) or BTF (.btf, .zip).";
const SCENES_WORDS = `A scene is one of ${SCENE_SUFFIXES.join(" ")}.`;

/** Where files belong that nothing here takes, by the kind of the first. */
function elsewhere([first]: readonly Dropped[], otherwise: string): string {
  const name = first?.path ?? "";
  if (endsWith(name, [...MEASURED_SUFFIXES, ...OTHER_MEASURED_SUFFIXES])) return MEASURED_WORDS;
  if (endsWith(name, SCENES_OF_OTHERS)) return `${SCENES_WORDS} Export it as .glb, and drop that on the start page.`;
  return otherwise;
}

/** Why the editor takes none of these files. */
export function refusalInEditor(files: readonly Dropped[]): string {
  const isForStart = files.some(isScene);
  const otherwise = isForStart
    ? "Scenes are imported on the start page; a BTF in a .zip goes into the Library."
    : "The editor takes images (.png, .jpg, .webp), environments (.hdr, .exr) and measured materials (.binary, .btf).";
  return `${namesOf(files)}: ${elsewhere(files, otherwise)}`;
}

/** Why the start page can import nothing of a drop, or not all of it; null where it can. A folder may hold anything. */
export function refusalOnStart(files: readonly Dropped[]): string | null {
  const formats = `${SCENES_WORDS} An environment is one of ${ENVIRONMENT_SUFFIXES.join(" ")}.`;
  const refused = files.filter((each) => !isOfUse(each) && !each.path.includes("/"));
  if (refused.length > 0) return `${namesOf(refused)}: ${elsewhere(refused, formats)}`;
  return files.some(isOfUse) ? null : `There is nothing to import in it. ${formats}`;
}
