/** The files that a scene file refers to, resolved among the dropped ones. */
import type { DroppedFile } from "./dropTypes";

interface References {
  companions: DroppedFile[];
  missing: string[];
}
type FindFile = (path: string) => DroppedFile | undefined;

const NO_REFERENCES: References = { companions: [], missing: [] };
/** Longer lists are not resolved; the server reports missing files. */
const MAX_TEXT_BYTES = 64 << 20;
const OBJ_HEAD_BYTES = 4 << 20;
const GLB_HEADER_BYTES = 20;

/** Resolve a reference in a scene file to a dropped path. */
export function resolvePath(scenePath: string, name: string): string {
  const steps = scenePath.split("/").slice(0, -1);
  for (const step of name.replaceAll("\\", "/").split("/")) {
    if (step === "..") steps.pop();
    else if (step !== "." && step !== "") steps.push(step);
  }
  return steps.join("/");
}

function decodeUri(uri: string): string {
  try {
    return decodeURIComponent(uri);
  } catch {
    return uri;
  }
}

function resolveReferences(scene: DroppedFile, names: readonly string[], findFile: FindFile): References {
  const companions = new Set<DroppedFile>();
  const missing = new Set<string>();
  for (const name of names) {
    const file = findFile(resolvePath(scene.path, decodeUri(name))) ?? findFile(resolvePath(scene.path, name));
    if (file !== undefined) companions.add(file);
    else missing.add(decodeUri(name));
  }
  return { companions: [...companions], missing: [...missing] };
}

/** URIs in a glTF file's JSON; none if it is unreadable, which the server will report. */
export function parseUris(text: string): string[] {
  try {
    const { buffers = [], images = [] } = JSON.parse(text) as Record<string, { uri?: unknown }[] | undefined>;
    const uris = [...buffers, ...images].map((each) => each.uri);
    return uris.filter((uri): uri is string => typeof uri === "string" && !uri.startsWith("data:"));
  } catch {
    return [];
  }
}

async function readGlbJson(file: File): Promise<string> {
  const header = new DataView(await file.slice(0, GLB_HEADER_BYTES).arrayBuffer());
  if (header.byteLength < GLB_HEADER_BYTES) return "";
  const length = header.getUint32(12, true);
  if (length > MAX_TEXT_BYTES) return "";
  return file.slice(GLB_HEADER_BYTES, GLB_HEADER_BYTES + length).text();
}

/** Material files that an .obj refers to, and the images whose names occur in them. */
async function findObjReferences(
  scene: DroppedFile,
  findFile: FindFile,
  images: readonly DroppedFile[],
): Promise<References> {
  const head = await scene.file.slice(0, OBJ_HEAD_BYTES).text();
  const names = [...head.matchAll(/^mtllib[ \t]+(.+?)[ \t]*\r?$/gm)].map((match) => match[1] as string);
  const libraries = resolveReferences(scene, names, findFile);
  const texts = await Promise.all(libraries.companions.map(({ file }) => file.slice(0, OBJ_HEAD_BYTES).text()));
  const materialText = texts.join("\n").toLowerCase();
  const namedImages = images.filter(({ file }) => materialText.includes(file.name.toLowerCase()));
  return { companions: [...libraries.companions, ...namedImages], missing: libraries.missing };
}

export async function findReferences(
  scene: DroppedFile,
  findFile: FindFile,
  images: readonly DroppedFile[],
): Promise<References> {
  const suffix = scene.path.toLowerCase().split(".").at(-1);
  if (suffix === "obj") return findObjReferences(scene, findFile, images);
  if (suffix === "glb") return resolveReferences(scene, parseUris(await readGlbJson(scene.file)), findFile);
  if (suffix === "gltf" && scene.file.size <= MAX_TEXT_BYTES)
    return resolveReferences(scene, parseUris(await scene.file.text()), findFile);
  return NO_REFERENCES;
}
