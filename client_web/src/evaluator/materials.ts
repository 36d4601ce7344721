/** What each material of a look makes use of, from the rows that `relume.moving.shader.tables` writes of it. */
import { GROUPS, type Kinds, MATERIAL } from "./common";
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
  /** The even and the uneven table of each group; of the sky in its highlights, and of other light in these. */
  tables: { plain: readonly number[]; highlights: readonly number[] };
  lobe: number;
}

/** How many functions the light vectors of a material have: of all light, and beside the sky. */
export type Functions = (name: "vectors" | "others", material: number) => number;

const EVEN = 0;
const UNEVEN = 1;
const SENDS = 2;
const TEXTURE = 3;

/** Read the rows of all materials. */
export function readMaterials(rows: Int32Array, functions: Functions): Material[] {
  const groups = Array.from({ length: GROUPS }, (_, group) => group);
  return Array.from({ length: rows.length / (4 * MATERIAL) }, (_, index) => {
    const at = (texel: number, number: number) => rows[4 * (index * MATERIAL + texel) + number] as number;
    const [lobe, normalMap, catches] = [at(GROUPS, 0), at(GROUPS, 1), at(GROUPS, 2)];
    const sending = groups.filter((group) => at(group, SENDS) > 0);
    const kinds = groups.map((group) => [at(group, EVEN), at(group, UNEVEN), ...[0, 1, 2, 3].map((k) => at(GROUPS + 2 + group, k))]);
    const kindsAt = (first: number): Kinds => ({
      even: kinds.map((of) => (of[first] as number) >= 0),
      uneven: kinds.map((of) => (of[first + 1] as number) >= 0),
    });
    const [plain, sky, beside] = [kindsAt(0), kindsAt(2), kindsAt(4)];
    const isAsked = (of: Kinds) => [...of.even, ...of.uneven].includes(true);
    return {
      points: {
        functions: isAsked(plain) || isAsked(sky) || normalMap >= 0 ? functions("vectors", index) : 0,
        others: isAsked(sky) || isAsked(beside) ? functions("others", index) : 0,
        plain,
        sky,
        beside,
        lobe: lobe >= 0,
        map: normalMap >= 0,
      },
      pixels: {
        groups: sending.some((group) => group > 0),
        textures: normalMap >= 0 || at(GROUPS + 1, TEXTURE) >= 0 || sending.some((group) => at(group, TEXTURE) >= 0),
        lobes: lobe >= 0,
        catches: catches === 1,
      },
      tables: { plain: kinds.flatMap((of) => of.slice(0, 2)), highlights: kinds.flatMap((of) => of.slice(2)) },
      lobe,
    };
  });
}

/** The layers of values that any material needs: see `pointShader`. */
export function layersOf(materials: readonly Material[]): number[] {
  const any = (is: (material: Material) => boolean) => materials.some(is);
  const [groups, map, lobes] = [any(({ pixels }) => pixels.groups), any(({ points }) => points.map), any(({ pixels }) => pixels.lobes)];
  return [0, ...(groups ? [1] : []), ...(groups || map ? [2] : []), ...(lobes ? [3, 4] : [])];
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
