/** The transform of a material's texture coordinates. */
import type { UvLook } from "../../../look.gen";
import type { MaterialLook, SceneMaterial } from "../../../protocol";
import { isImageReference } from "../../../state/document/imageReference";

export type UvTransform = Required<UvLook>;

export const IDENTITY: UvTransform = { scale: [1, 1], rotation: 0, offset: [0, 0] };

/** The transform of a material; the identity without one. */
export function uvOf(material: MaterialLook): UvTransform {
  return { ...IDENTITY, ...material.uv };
}

/** The material with a changed transform; without the field for the identity, as the server has it. */
export function withUv(material: MaterialLook, change: Partial<UvTransform>): MaterialLook {
  const { uv: _before, ...rest } = material;
  const uv = { ...uvOf(material), ...change };
  const isIdentity = [...uv.scale, uv.rotation, ...uv.offset].join() === "1,1,0,0,0";
  return isIdentity ? rest : { ...rest, uv };
}

/** True if a material has an image to place: of the scene or an uploaded one. One that is placed already counts.
 * Terms name the scene's textures whether it has them or not. */
export function hasImages({ terms, normal_map, uv }: MaterialLook, own?: SceneMaterial): boolean {
  return (
    own?.is_textured === true ||
    normal_map != null ||
    uv != null ||
    terms.some((term) => isImageReference(term.texture) || term.roughness_map != null)
  );
}
