/** References of terms to textures and roughness maps. */
const IMAGE_PREFIX = "image:";
type ImageReference = `${typeof IMAGE_PREFIX}${string}`;

/** True if a reference is an uploaded image, not one of the material's own maps. */
export const isImageReference = (texture: string | boolean | null | undefined): texture is ImageReference =>
  typeof texture === "string" && texture.startsWith(IMAGE_PREFIX);
