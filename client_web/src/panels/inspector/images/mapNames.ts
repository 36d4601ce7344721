/** Detects the kind of a texture map from its file name, by the conventions of texture libraries. */

/** File name endings and their kinds of map. */
const MAPS: readonly (readonly [RegExp, string])[] = [
  [/^rough(ness)?$/, "roughness"],
  [/^gloss(iness)?$/, "gloss"],
  [/^(arm|orm|rma|metallicroughness|roughnessmetal(lic|ness)?)$/, "roughness and metal"],
  [/^(metal(lic|ness)?)$/, "metal"],
  [/^(nor|nrm|normals?)dx$/, "DirectX normals"],
  [/^(nor|nrm|normals?)(gl)?$/, "normals"],
  [/^(bump|height|disp(lacement)?)$/, "height"],
  [/^(emission|emissive|emit|glow)$/, "emission"],
  [/^(ao|ambientocclusion|occlusion)$/, "occlusion"],
  [/^(opacity|alpha|mask|transparency)$/, "opacity"],
  [/^(spec(ular)?|reflection|reflectivity)$/, "specular"],
];
const COLORS = /^(base|albedo|diff(use)?|col(ou?r)?|basecolou?r)$/;

/** Endings of a file name: the last word, and the last two joined; sizes such as 2k are skipped. */
function nameEndings(file: string): string[] {
  const plain = file.replace(/\.\w+$/, "").replace(/([a-z])([A-Z])/g, "$1 $2");
  const nameWords = plain
    .toLowerCase()
    .split(/[^a-z]+/)
    .filter((word) => word.length > 1);
  return nameWords.length < 2 ? [] : [nameWords.slice(-1), nameWords.slice(-2)].map((last) => last.join(""));
}

/** The kind of map of an image; null for colors. */
export function detectMap(file: string): string | null {
  const ends = nameEndings(file);
  return MAPS.find(([name]) => ends.some((end) => name.test(end)))?.[1] ?? null;
}

/** True if the file name marks a base color texture. */
export function isColorName(file: string): boolean {
  return nameEndings(file).some((end) => COLORS.test(end));
}
