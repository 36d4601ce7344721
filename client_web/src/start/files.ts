/** Which of the dropped files are the scene and the environment. */

export interface Chosen {
  scene: File | null;
  environment: File | null;
  /** Names of files that are neither. */
  refused: string[];
}

export function sortFiles(files: readonly File[], before: Chosen): Chosen {
  const next: Chosen = { ...before, refused: [] };
  for (const file of files) {
    const name = file.name.toLowerCase();
    if (name.endsWith(".glb")) next.scene = file;
    else if (name.endsWith(".hdr") || name.endsWith(".exr")) next.environment = file;
    else next.refused.push(file.name);
  }
  return next;
}
