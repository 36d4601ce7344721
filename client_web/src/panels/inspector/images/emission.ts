/** The light by which a material emits: its image is a field of that light. */
import { nextLightName } from "../../lights/lightKinds";
import { DEFAULT_LIGHTS, MAX_LIGHT_NAME, MAX_LIGHTS } from "../../../look.gen";
import type { Light, Look } from "../../../protocol";

type Lights = Look["lights"];
type MeshLight = Extract<Light, { kind: "mesh" }>;

export interface NamedMeshLight {
  name: string;
  light: MeshLight;
}

/** The light of a material; null if the material does not emit. */
export function meshLightOf(lights: Lights, material: string): NamedMeshLight | null {
  for (const [name, light] of Object.entries(lights)) {
    if (light.kind === "mesh" && light.material === material) return { name, light };
  }
  return null;
}

const isMerged = (lights: Lights, material: string) =>
  Object.values(lights).some(
    (light) => light.kind === "surfaces" && light.materials.some(([emissive]) => emissive === material),
  );

/** The light by which a material emits an image; null if there are too many lights for a new one, or if the material
 * is of a source of several. */
export function emittingLight(lights: Lights, material: string, image: string): NamedMeshLight | null {
  const existing = meshLightOf(lights, material);
  if (existing !== null) return { ...existing, light: { ...existing.light, image, enabled: true } };
  const names = Object.keys(lights);
  if (names.length >= MAX_LIGHTS || isMerged(lights, material)) return null;
  const name = nextLightName(material.slice(0, MAX_LIGHT_NAME), names);
  return { name, light: { ...DEFAULT_LIGHTS.mesh, material, image } };
}

/** The light of a material without an image; undefined if the editor added it for one. */
export function lightWithoutImage({ name, light }: NamedMeshLight, own: Lights): Light | undefined {
  return own[name] === undefined ? undefined : { ...light, image: null };
}
