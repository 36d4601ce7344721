/** Features of each material of a look, from the rows written by `relume.live.free_camera.browser.material_arrays`. */
import { NUM_GROUPS, type TableKinds, MATERIAL_TEXELS } from "./dataLayout";
import type { ProbeFeatures } from "./probeShader";

/** Features of a material in the surface shader. */
export interface MaterialFeatures {
  /** A textured group has outgoing radiance. */
  groups: boolean;
  /** A texture, a normal map or an emission map. */
  textures: boolean;
  lobes: boolean;
  catchesShadows: boolean;
}

export interface RendererMaterial {
  points: ProbeFeatures;
  pixels: MaterialFeatures;
  /** Isotropic and anisotropic table of each group; the same for the environment and for other light in highlights. */
  tables: { plain: readonly number[]; highlights: readonly number[] };
  lobe: number;
}

/** Number of basis functions of a material's incident radiance coefficients: all light, and light except the environment. */
export type FunctionCounts = (name: "vectors" | "others", material: number) => number;

const ISOTROPIC_TABLE = 0;
const ANISOTROPIC_TABLE = 1;
const EMISSION = 2;
const TEXTURE = 3;

/** Read the rows of all materials. */
export function readMaterials(rows: Int32Array, functions: FunctionCounts): RendererMaterial[] {
  const groups = Array.from({ length: NUM_GROUPS }, (_, group) => group);
  return Array.from({ length: rows.length / (4 * MATERIAL_TEXELS) }, (_, index) => {
    const tableValue = (texel: number, number: number) =>
      rows[4 * (index * MATERIAL_TEXELS + texel) + number] as number;
    const [lobe, normalMap, catchesShadows] = [
      tableValue(NUM_GROUPS, 0),
      tableValue(NUM_GROUPS, 1),
      tableValue(NUM_GROUPS, 2),
    ];
    const emittingGroups = groups.filter((group) => tableValue(group, EMISSION) > 0);
    const kinds = groups.map((group) => [
      tableValue(group, ISOTROPIC_TABLE),
      tableValue(group, ANISOTROPIC_TABLE),
      ...[0, 1, 2, 3].map((k) => tableValue(NUM_GROUPS + 2 + group, k)),
    ]);
    const kindsAt = (first: number): TableKinds => ({
      isotropic: kinds.map((indices) => (indices[first] as number) >= 0),
      anisotropic: kinds.map((indices) => (indices[first + 1] as number) >= 0),
    });
    const [plain, environment, otherLight] = [kindsAt(0), kindsAt(2), kindsAt(4)];
    const hasTables = (indices: TableKinds) => [...indices.isotropic, ...indices.anisotropic].includes(true);
    return {
      points: {
        functions: hasTables(plain) || hasTables(environment) || normalMap >= 0 ? functions("vectors", index) : 0,
        otherFunctions: hasTables(environment) || hasTables(otherLight) ? functions("others", index) : 0,
        plain,
        environment,
        otherLight,
        lobe: lobe >= 0,
        map: normalMap >= 0,
      },
      pixels: {
        groups: emittingGroups.some((group) => group > 0),
        textures:
          normalMap >= 0 ||
          tableValue(NUM_GROUPS + 1, TEXTURE) >= 0 ||
          emittingGroups.some((group) => tableValue(group, TEXTURE) >= 0),
        lobes: lobe >= 0,
        catchesShadows: catchesShadows === 1,
      },
      tables: {
        plain: kinds.flatMap((indices) => indices.slice(0, 2)),
        highlights: kinds.flatMap((kinds) => kinds.slice(2)),
      },
      lobe,
    };
  });
}

/** The value layers that some material needs: see `probeShader`. */
export function layersOfMaterials(materials: readonly RendererMaterial[]): number[] {
  const any = (is: (material: RendererMaterial) => boolean) => materials.some(is);
  const [groups, map, lobes] = [
    any(({ pixels }) => pixels.groups),
    any(({ points }) => points.map),
    any(({ pixels }) => pixels.lobes),
  ];
  return [0, ...(groups ? [1] : []), ...(groups || map ? [2] : []), ...(lobes ? [3, 4] : [])];
}

/** Faces with the same features, as corner numbers in face order. */
export interface FaceClass {
  shows: MaterialFeatures;
  corners: Uint32Array;
}

/** Group faces by the features of their materials. `materialOf`: material per face. */
export function groupFaces(materials: readonly RendererMaterial[], materialOf: Uint32Array): FaceClass[] {
  const keys = materials.map(({ pixels }) => JSON.stringify(pixels));
  return [...new Set(keys)].map((key) => {
    const isOfMaterial = keys.map((otherKey) => otherKey === key);
    const faces = materialOf.reduce((sum, material) => sum + Number(isOfMaterial[material]), 0);
    const corners = new Uint32Array(3 * faces);
    let end = 0;
    materialOf.forEach((material, face) => {
      if (!isOfMaterial[material]) return;
      for (let corner = 0; corner < 3; corner++) corners[end++] = 3 * face + corner;
    });
    return { shows: JSON.parse(key) as MaterialFeatures, corners };
  });
}
