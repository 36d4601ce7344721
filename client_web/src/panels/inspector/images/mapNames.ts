/** What an image is a map of, by its file's name, as libraries of textures write it. */

/** Endings of file names, and the kinds of map they mean. */
const MAPS: readonly (readonly [RegExp, string])[] = [
  [/^rough(ness)?$/, "roughness"],
  [/^gloss(iness)?$/, "gloss"],
  [/^(arm|orm|rma|metallicroughness|roughnessmetal(lic|ness)?)$/, "roughness and metal"],
  [/^(metal(lic|ness)?)$/, "metal"],
  [/^(nor|nrm|normals?)dx$/, "normals for DirectX"],
  [/^(nor|nrm|normals?)(gl)?$/, "normals"],
  [/^(bump|height|disp(lacement)?)$/, "heights"],
  [/^(emission|emissive|emit|glow)$/, "what shines"],
  [/^(ao|ambientocclusion|occlusion)$/, "occlusion"],
  [/^(opacity|alpha|mask|transparency)$/, "opacity"],
  [/^(spec(ular)?|reflection|reflectivity)$/, "reflectance"],
];
const COLORS = /^(base|albedo|diff(use)?|col(ou?r)?|basecolou?r)$/;

/** Endings of a file name: the last word, and the last two as one; sizes such as 2k are skipped. */
function nameEndings(file: string): string[] {
  const plain = file.replace(/\.\w+$/, "").replace(/([a-z])([A-Z])/g, "$1 $2");
  const nameWords = plain
    .toLowerCase()
    .split(/[^a-z]+/)
    .filter((word) => word.length > 1);
  return nameWords.length < 2 ? [] : [nameWords.slice(-1), nameWords.slice(-2)].map((last) => last.join(""));
}

/** What an image is a map of, where that is no color. */
export function detectMap(file: string): string | null {
  const ends = nameEndings(file);
  return MAPS.find(([name]) => ends.some((end) => name.test(end)))?.[1] ?? null;
}

/** Whether an image is named as one of the base color. */
export function isColorName(file: string): boolean {
  return nameEndings(file).some((end) => COLORS.test(end));
}
