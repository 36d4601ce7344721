/** The files that a scene file names, looked for among those that were dropped with it. */
import type { Dropped } from "./dropped";

interface Named {
  companions: Dropped[];
  missing: string[];
}
type Find = (path: string) => Dropped | undefined;

const NOTHING: Named = { companions: [], missing: [] };
/** Longer lists of names are not looked at; the server says what it misses. */
const MAX_TEXT_BYTES = 64 << 20;
const OBJ_HEAD_BYTES = 4 << 20;
const GLB_HEADER_BYTES = 20;

/** A name in a scene file as a path among the dropped ones. */
export function resolve(scenePath: string, name: string): string {
  const steps = scenePath.split("/").slice(0, -1);
  for (const step of name.replaceAll("\\", "/").split("/")) {
    if (step === "..") steps.pop();
    else if (step !== "." && step !== "") steps.push(step);
  }
  return steps.join("/");
}

function decoded(uri: string): string {
  try {
    return decodeURIComponent(uri);
  } catch {
    return uri;
  }
}

function find(scene: Dropped, names: readonly string[], among: Find): Named {
  const companions = new Set<Dropped>();
  const missing = new Set<string>();
  for (const name of names) {
    const found = among(resolve(scene.path, decoded(name))) ?? among(resolve(scene.path, name));
    if (found !== undefined) companions.add(found);
    else missing.add(decoded(name));
  }
  return { companions: [...companions], missing: [...missing] };
}

/** Addresses in the JSON of a glTF file; none where it cannot be read, which the server will say. */
export function urisOf(text: string): string[] {
  try {
    const { buffers = [], images = [] } = JSON.parse(text) as Record<string, { uri?: unknown }[] | undefined>;
    const uris = [...buffers, ...images].map((each) => each.uri);
    return uris.filter((uri): uri is string => typeof uri === "string" && !uri.startsWith("data:"));
  } catch {
    return [];
  }
}

async function glbText(file: File): Promise<string> {
  const header = new DataView(await file.slice(0, GLB_HEADER_BYTES).arrayBuffer());
  if (header.byteLength < GLB_HEADER_BYTES) return "";
  const length = header.getUint32(12, true);
  if (length > MAX_TEXT_BYTES) return "";
  return file.slice(GLB_HEADER_BYTES, GLB_HEADER_BYTES + length).text();
}

/** Material files that an .obj names, and of the images those whose names stand in them. */
async function ofObj(scene: Dropped, among: Find, images: readonly Dropped[]): Promise<Named> {
  const head = await scene.file.slice(0, OBJ_HEAD_BYTES).text();
  const names = [...head.matchAll(/^mtllib[ \t]+(.+?)[ \t]*\r?$/gm)].map((match) => match[1] as string);
  const libraries = find(scene, names, among);
  const texts = await Promise.all(libraries.companions.map(({ file }) => file.slice(0, OBJ_HEAD_BYTES).text()));
  const words = texts.join("\n").toLowerCase();
  const named = images.filter(({ file }) => words.includes(file.name.toLowerCase()));
  return { companions: [...libraries.companions, ...named], missing: libraries.missing };
}

export async function namedBy(scene: Dropped, among: Find, images: readonly Dropped[]): Promise<Named> {
  const suffix = scene.path.toLowerCase().split(".").at(-1);
  if (suffix === "obj") return ofObj(scene, among, images);
  if (suffix === "glb") return find(scene, urisOf(await glbText(scene.file)), among);
  if (suffix === "gltf" && scene.file.size <= MAX_TEXT_BYTES)
    return find(scene, urisOf(await scene.file.text()), among);
  return NOTHING;
}
