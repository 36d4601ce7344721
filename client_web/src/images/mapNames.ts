/** What an image is a map of, by its file's name, as libraries of textures write it. */

/** Last words of file names, and what such images are maps of. */
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

/** Words at the end of a file's name: the last one, and the last two as one; sizes such as 2k are no words of it. */
function endsOf(file: string): string[] {
  const plain = file.replace(/\.\w+$/, "").replace(/([a-z])([A-Z])/g, "$1 $2");
  const words = plain
    .toLowerCase()
    .split(/[^a-z]+/)
    .filter((word) => word.length > 1);
  return words.length < 2 ? [] : [words.slice(-1), words.slice(-2)].map((last) => last.join(""));
}

/** What an image is a map of, where that is no color. */
export function mapNamed(file: string): string | null {
  const ends = endsOf(file);
  return MAPS.find(([name]) => ends.some((end) => name.test(end)))?.[1] ?? null;
}

/** Whether an image is named as one of the base color. */
export function isColorNamed(file: string): boolean {
  return endsOf(file).some((end) => COLORS.test(end));
}
