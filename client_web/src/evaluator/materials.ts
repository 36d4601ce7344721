/** What each material of a look makes use of, from the rows that `relume.moving.shader.tables` writes of it. */
import { GROUPS, MATERIAL } from "./common";
import type { PointFeatures } from "./pointShader";

/** What pixels of a material make use of. */
export interface Shows {
  /** Terms that textures may multiply send something. */
  groups: boolean;
  /** A texture, a normal map or an image of what it shines. */
  textures: boolean;
  lobes: boolean;
  catches: boolean;
}

export interface Material {
  points: PointFeatures;
  pixels: Shows;
  /** The even and the uneven table of each group. */
  tables: readonly number[];
  lobe: number;
}

/** How many functions the light vectors of a material have: of all light, and beside the sky. */
export type Functions = (name: "vectors" | "others", material: number) => number;

const EVEN = 0;
const UNEVEN = 1;
const SENDS = 2;
const TEXTURE = 3;

/** Read the rows of all materials. `lobes`: texels of four, `tableRows` rows of each. */
export function readMaterials(rows: Int32Array, lobes: Float32Array, tableRows: number, functions: Functions): Material[] {
  const groups = Array.from({ length: GROUPS }, (_, group) => group);
  return Array.from({ length: rows.length / (4 * MATERIAL) }, (_, index) => {
    const at = (texel: number, number: number) => rows[4 * (index * MATERIAL + texel) + number] as number;
    const [lobe, normalMap, catches] = [at(GROUPS, 0), at(GROUPS, 1), at(GROUPS, 2)];
    const sending = groups.filter((group) => at(group, SENDS) > 0);
    const [even, uneven] = [EVEN, UNEVEN].map((kind) => groups.map((group) => at(group, kind) >= 0)) as [boolean[], boolean[]];
    const isTold = (lobes[4 * ((lobe * tableRows + 1) * (GROUPS + 1) - 1) + 2] ?? 0) > 0;
    const isAsked = [...even, ...uneven, normalMap >= 0].includes(true);
    const kind = lobe < 0 ? "none" : isTold ? "told" : "narrow";
    return {
      points: {
        functions: isAsked ? functions("vectors", index) : 0,
        even,
        uneven,
        lobe: kind,
        others: kind === "narrow" ? functions("others", index) : 0,
        map: normalMap >= 0,
      },
      pixels: {
        groups: sending.some((group) => group > 0),
        textures: normalMap >= 0 || at(GROUPS + 1, TEXTURE) >= 0 || sending.some((group) => at(group, TEXTURE) >= 0),
        lobes: lobe >= 0,
        catches: catches === 1,
      },
      tables: groups.flatMap((group) => [at(group, EVEN), at(group, UNEVEN)]),
      lobe,
    };
  });
}

/** The layers of values that any material needs: see `pointShader`. */
export function layersOf(materials: readonly Material[]): number[] {
  const any = (is: (material: Material) => boolean) => materials.some(is);
  const [groups, map, lobes] = [any(({ pixels }) => pixels.groups), any(({ points }) => points.map), any(({ pixels }) => pixels.lobes)];
  return [0, ...(groups ? [1] : []), ...(groups || map ? [2] : []), ...(lobes ? [3] : [])];
}

/** Faces that show the same features, as the numbers of their corners; in the order of the faces. */
export interface FaceClass {
  shows: Shows;
  corners: Uint32Array;
}

/** Sort faces by what their materials show. `materialOf`: of each face. */
export function classesOf(materials: readonly Material[], materialOf: Uint32Array): FaceClass[] {
  const keys = materials.map(({ pixels }) => JSON.stringify(pixels));
  return [...new Set(keys)].map((key) => {
    const isHere = keys.map((other) => other === key);
    const faces = materialOf.reduce((sum, material) => sum + Number(isHere[material]), 0);
    const corners = new Uint32Array(3 * faces);
    let end = 0;
    materialOf.forEach((material, face) => {
      if (!isHere[material]) return;
      for (let corner = 0; corner < 3; corner++) corners[end++] = 3 * face + corner;
    });
    return { shows: JSON.parse(key) as Shows, corners };
  });
}
