/** Which of the dropped files are the scene and the environment. */

/** As the server reads them; a scene of several files comes as one .zip. */
export const SCENE_SUFFIXES = [".glb", ".gltf", ".obj", ".ply", ".zip"];
export const ENVIRONMENT_SUFFIXES = [".hdr", ".exr"];

export interface Chosen {
  scene: File | null;
  environment: File | null;
  /** Names of files that are neither. */
  refused: string[];
}

function endsWith(file: File, suffixes: readonly string[]): boolean {
  return suffixes.some((suffix) => file.name.toLowerCase().endsWith(suffix));
}

export function isEnvironment(file: File): boolean {
  return endsWith(file, ENVIRONMENT_SUFFIXES);
}

/** A file's name without what it ends with. */
export function stem(name: string): string {
  return name.replace(/\.[^.]+$/, "");
}

export function sortFiles(files: readonly File[], before: Chosen): Chosen {
  const next: Chosen = { ...before, refused: [] };
  for (const file of files) {
    if (endsWith(file, SCENE_SUFFIXES)) next.scene = file;
    else if (isEnvironment(file)) next.environment = file;
    else next.refused.push(file.name);
  }
  return next;
}
